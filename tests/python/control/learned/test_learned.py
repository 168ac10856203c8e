"""The method "learned": its plan, and when it falls back to analytic control."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import MpmSolver, Scene, scenarios
from hybridmpm.control import Arrow, Ellipse, Guidance, follow, prepare
from hybridmpm.control.goal.moments import moments
from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.learned import plan
from hybridmpm.control.methods.learned.network import TransportNetwork
from hybridmpm.control.methods.learned.plan import Learned
from hybridmpm.errors import ConfigError, DataError

NetworkFile = Callable[..., Path]
OVAL = Ellipse(np.array([0.45, 0.5]), np.array([0.2, 0.12]), 0.3)
ARROW = Arrow(np.array([[0.4, 0.4], [0.4, 0.45]]))


@pytest.fixture(scope="module")
def solver() -> MpmSolver:
    """Return water in the splash."""
    solver = MpmSolver(scenarios.get("water_2d", 3))
    solver.advance(120)
    return solver


def planned(solver: MpmSolver, path: Path, sketch: Any = OVAL, **settings: Any) -> Guidance:
    return prepare(solver, sketch, method=Learned(str(path)), **{"frames": 100, **settings})


def ends(guidance: Guidance) -> np.ndarray[Any, Any]:
    """Return where the law leads the particles (N, D)."""
    law = guidance.law
    assert isinstance(law, Tracked)
    last = law.x[law.starts[1:].astype(int) - 1]
    return np.asarray(last[law.path] + law.offset, dtype=np.float64)


def test_the_plan_has_what_the_sketch_tells(solver: MpmSolver, network_file: NetworkFile) -> None:
    """An oval stands for a mean and a covariance: two standard deviations are its semi-axes."""
    guidance = planned(solver, network_file())
    assert guidance.method == "learned"
    mean, covariance = moments(ends(guidance), guidance.goal.cloud.weight)
    np.testing.assert_allclose(mean, OVAL.center, atol=2e-3)
    axes = 2 * np.sqrt(np.linalg.eigvalsh(covariance))[::-1]
    np.testing.assert_allclose(axes, OVAL.axes, rtol=0.05)


def test_a_plan_in_3d_fits_the_front_view_and_keeps_its_depth(network_file: NetworkFile) -> None:
    solver = MpmSolver(scenarios.get("water_3d", 3))
    solver.advance(80)
    guidance = planned(solver, network_file(scenario="water_3d"))
    assert guidance.method == "learned", guidance.reason
    cloud = guidance.goal.cloud
    mean, covariance = moments(ends(guidance), cloud.weight)
    np.testing.assert_allclose(mean[:2], OVAL.center, atol=2e-3)
    assert mean[2] == pytest.approx(cloud.centroid[2], abs=2e-3)
    axes = 2 * np.sqrt(np.linalg.eigvalsh(covariance[:2, :2]))[::-1]
    np.testing.assert_allclose(axes, OVAL.axes, rtol=0.05)
    assert covariance[2, 2] == pytest.approx(moments(cloud.x, cloud.weight)[1][2, 2], rel=0.02)


def test_an_arrow_moves_the_mean_and_leaves_the_shape_to_the_network(
    solver: MpmSolver, network_file: NetworkFile
) -> None:
    guidance = planned(solver, network_file(0.9), ARROW)
    assert guidance.method == "learned"
    cloud, places = guidance.goal.cloud, ends(guidance)
    np.testing.assert_allclose(
        cloud.weight @ (places - cloud.x), guidance.goal.target_displacement, atol=5e-3
    )
    shrunk = np.sqrt(
        np.linalg.det(moments(places, cloud.weight)[1] @ np.linalg.inv(moments(cloud.x, cloud.weight)[1]))
    )
    assert shrunk == pytest.approx(0.9**2, rel=0.05)


def test_seeds_choose_among_ends(solver: MpmSolver, network_file: NetworkFile) -> None:
    one, again, other = (ends(planned(solver, network_file(noise=0.3), seed=seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.linalg.norm(one - other, axis=1).mean() > 0.005


def test_it_is_followed(solver: MpmSolver, network_file: NetworkFile) -> None:
    twin = solver.copy()
    reached = follow(twin, ARROW, Learned(str(network_file())), frames=60).run().reached
    assert reached.miss < 0.02


@pytest.mark.parametrize(
    ("factor", "why"),
    [(float("nan"), "not finite"), (0.0, "too densely|not finite"), (1e3, "out of")],
)
def test_a_plan_that_cannot_be_trusted_falls_back(
    solver: MpmSolver, network_file: NetworkFile, factor: float, why: str
) -> None:
    for sketch in (OVAL, ARROW):
        if factor == 1e3 and sketch is OVAL:
            continue  # the covariance of an oval takes the factor out again
        guidance = planned(solver, network_file(factor), sketch)
        assert guidance.method == "analytic"
        np.testing.assert_array_equal(
            ends(guidance), ends(prepare(solver, sketch, method="analytic", frames=100))
        )
        assert guidance.reason.startswith("learned falls back to analytic: ")
        assert re.search(why, guidance.reason)


def test_more_force_than_allowed_falls_back(solver: MpmSolver, network_file: NetworkFile) -> None:
    """Particles that change sides need more force than those that go the nearest way."""
    guidance = planned(solver, network_file(-1.0), frames=60, cap=4.0)
    assert "g are allowed" in guidance.reason


def _like(**changes: Any) -> Scene:
    return scenarios.get("water_2d", 3).model_copy(update=changes)


@pytest.mark.parametrize(
    ("scene", "why"),
    [
        (scenarios.get("water_3d", 3), "2D only"),
        (scenarios.get("water_ramps_2d", 3), "without obstacles"),
        (scenarios.get("sand_2d", 3), "without sand"),
        (_like(gravity=(0.0, -3.7)), "another gravity"),
    ],
)
def test_other_scenes_fall_back(scene: Scene, why: str, network_file: NetworkFile) -> None:
    guidance = planned(MpmSolver(scene), network_file(), ARROW)
    assert guidance.method == "analytic"
    assert why in guidance.reason


def test_a_network_in_3d_is_not_for_2d(solver: MpmSolver, network_file: NetworkFile) -> None:
    guidance = planned(solver, network_file(scenario="water_3d"), ARROW)
    assert guidance.method == "analytic"
    assert "cannot serve this scene: it is trained in 3D only" in guidance.reason


def test_absent_weights_fall_back(solver: MpmSolver, tmp_path: Path) -> None:
    guidance = planned(solver, tmp_path / "none.onnx")
    assert guidance.method == "analytic"
    assert "none.onnx" in guidance.reason


def test_a_runtime_that_fails_falls_back(
    solver: MpmSolver, network_file: NetworkFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("out of memory")

    monkeypatch.setattr(plan.TransportNetwork, "ends", fail)
    assert "out of memory" in planned(solver, network_file()).reason


def test_damaged_files_are_refused(network_file: NetworkFile, tmp_path: Path) -> None:
    data = network_file().read_bytes()
    with pytest.raises(DataError, match="damaged or cut off"):
        TransportNetwork(data[: len(data) // 2], where="half")
    with pytest.raises(DataError, match="cannot read"):
        TransportNetwork.load(tmp_path / "none.onnx")
    with pytest.raises(ConfigError, match="evaluations"):
        TransportNetwork(data, where="whole").ends(
            None,
            None,
            seed=0,
            evaluations=0,  # type: ignore[arg-type]
        )

"""The method "learned": its features, its plan, and when it falls back to analytic control."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import MpmSolver, Scene, scenarios
from hybridmpm.control import Arrow, Ellipse, Guidance, follow, prepare
from hybridmpm.control.goal.cloud import Cloud
from hybridmpm.control.goal.moments import moments
from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.learned import plan
from hybridmpm.control.methods.learned.features import PLANES, Aim, State, channels, inputs, raster
from hybridmpm.control.methods.learned.network import TransportNetwork
from hybridmpm.control.methods.learned.noise import smooth_noise
from hybridmpm.control.methods.learned.plan import Learned
from hybridmpm.control.methods.learned.spec import CELLS, TransportSpec
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
    return law.places


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
    ("factor", "why"), [(float("nan"), "not finite"), (0.0, "too densely|not finite"), (1e3, "out of")]
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


AIM = Aim(np.array([0.4, 0.5]), np.array([[0.08, 0.02], [0.02, 0.05]]), 0.25)
AIM_3D = replace(AIM, mean=np.array([0.4, 0.5, 0.3]))
EVERY_PLANE = [(dim, plane) for dim, planes in PLANES.items() for plane in planes]


def state(dim: int = 2) -> State:
    scene = scenarios.get(f"water_{dim}d", 5)
    solver = MpmSolver(scene)
    solver.advance(60)
    cloud = Cloud.of(solver)
    lower, upper = (np.array(corner) for corner in (scene.walls.lower, scene.walls.upper))
    sand = np.arange(len(cloud.x)) % 3 == 0
    return State(
        cloud.x, cloud.v, sand, cloud.weight, scene.spacing**dim, lower, upper, np.array(scene.gravity)
    )


@pytest.mark.parametrize(("dim", "plane"), EVERY_PLANE)
def test_a_raster_keeps_volume_momentum_energy_and_depth(dim: int, plane: tuple[int, int]) -> None:
    one = state(dim)
    seen = raster(one, plane)
    axes = [*plane, *(axis for axis in range(dim) if axis not in plane)]
    column = np.prod(one.upper - one.lower) / CELLS**2 / (8 if dim == 3 else 1)
    assert seen.fill.sum() * column == pytest.approx(len(one.x) * one.particle_volume)
    assert seen.sand.sum() == pytest.approx(seen.fill.sum() * one.sand.mean())
    mass = seen.fill * column / one.particle_volume
    momentum = one.v[:, axes].sum(axis=0)
    np.testing.assert_allclose((mass * seen.velocity).sum(axis=(1, 2)), momentum, rtol=1e-3)
    energy = (mass * ((seen.velocity**2).sum(axis=0) + seen.deviation**2)).sum()
    assert energy == pytest.approx((one.v**2).sum(), rel=1e-3)
    assert len(seen.depth) == (2 if dim == 3 else 0)
    if dim == 3:
        away = one.x[:, axes[2]] - 0.5
        mean, deviation = seen.depth
        assert (mass * mean).sum() == pytest.approx(away.sum(), rel=1e-3)
        assert (mass * (mean**2 + deviation**2)).sum() == pytest.approx((away**2).sum(), rel=1e-3)


@pytest.mark.parametrize("plane", PLANES[3])
def test_a_plane_is_the_projection_of_a_state(plane: tuple[int, int]) -> None:
    """Particle by particle: the four cells around each get its share, the nearest the most."""
    whole = state(3)
    one = replace(whole, x=whole.x[::40], v=whole.v[::40], sand=whole.sand[::40], weight=whole.weight[::40])
    a, b = plane
    (depth,) = {0, 1, 2} - {a, b}
    sums = np.zeros((4, CELLS, CELLS))
    for x, v in zip(one.x, one.v, strict=True):
        u, w = (np.clip((x[axis] - one.lower[axis]) / 0.8 * CELLS - 0.5, 0, CELLS - 1) for axis in plane)
        for column in range(CELLS):
            for row in (int(w), min(int(w) + 1, CELLS - 1)):
                share = max(0.0, 1 - abs(u - column)) * max(0.0, 1 - abs(w - row))
                if row == int(w) + 1 or w < CELLS - 1 or row == CELLS - 1:
                    sums[:, row, column] += share * np.array([1.0, v[a], v[depth], x[depth] - 0.5])
    seen = raster(one, plane)
    there = sums[0] > 1e-3
    fill = sums[0] * 8 * one.particle_volume / (0.8**3 / CELLS**2)
    np.testing.assert_allclose(seen.fill, fill, atol=1e-9)
    np.testing.assert_allclose(
        seen.velocity[0][there], (sums[1] / np.where(there, sums[0], 1))[there], atol=1e-9
    )
    np.testing.assert_allclose(
        seen.velocity[2][there], (sums[2] / np.where(there, sums[0], 1))[there], atol=1e-9
    )
    np.testing.assert_allclose(
        seen.depth[0][there], (sums[3] / np.where(there, sums[0], 1))[there], atol=1e-9
    )


def test_a_mirrored_state_has_mirrored_features() -> None:
    """Left and right are alike: the network may be trained on mirrored states."""
    one = state()
    both, sign = one.lower[0] + one.upper[0], np.array([-1.0, 1.0])
    shift = np.array([both, 0.0])
    flipped = replace(one, x=shift + sign * one.x, v=sign * one.v)
    assert AIM.root is not None
    aim = Aim(shift + sign * AIM.mean, AIM.root * np.outer(sign, sign), AIM.seconds)
    mine, other = (inputs([a], [b], [None], obstacles=False) for a, b in ((one, AIM), (flipped, aim)))
    signs = np.ones(10)
    signs[[1, 5, 8]] = -1
    np.testing.assert_allclose(other.grid[0], signs[:, None, None] * mine.grid[0, :, :, ::-1], atol=1e-5)
    signs = np.ones(13)
    signs[0:12:2] = -1
    np.testing.assert_allclose(other.particles[0], signs * mine.particles[0], atol=1e-4)


def test_a_turned_state_is_seen_turned() -> None:
    """A quarter turn about the vertical exchanges what front and side show of the state."""
    one = state(3)
    turned = replace(one, x=one.x[:, [2, 1, 0]], v=one.v[:, [2, 1, 0]])
    mine, other = (inputs([each], [AIM_3D], [None], obstacles=False).grid[0] for each in (one, turned))
    of_state, count = slice(0, 8), channels(3, obstacles=False)
    front, side = (slice(plane * count, (plane + 1) * count) for plane in (0, 1))
    np.testing.assert_allclose(other[side][of_state], mine[front][of_state], atol=1e-5)
    np.testing.assert_allclose(other[front][of_state], mine[side][of_state], atol=1e-5)


def test_depth_has_a_scale_and_no_wish() -> None:
    """The covariance of an oval is that of the front view; in depth its geometric mean is the unit."""
    assert AIM_3D.root is not None
    frame = AIM_3D.frame
    np.testing.assert_array_equal(frame[:2, :2], AIM_3D.root)
    np.testing.assert_array_equal(frame[2, :2], 0)
    assert frame[2, 2] == pytest.approx(np.sqrt(np.linalg.det(AIM_3D.root)))
    for plane in PLANES[3]:
        axes = list(plane)
        wanted = np.diag((frame @ frame.T)[axes, axes])
        found = AIM_3D.on_plane(plane)
        np.testing.assert_allclose(np.diag(np.diag(found @ found.T)), wanted)


def test_own_coordinates_go_back_to_metres() -> None:
    points = np.random.default_rng(0).uniform(0.1, 0.9, (50, 3))
    for aim in (AIM, replace(AIM, root=None), AIM_3D, replace(AIM_3D, root=None)):
        x = points[:, : len(aim.mean)]
        np.testing.assert_allclose(aim.to_metres(aim.to_own(x)), x, atol=1e-12)


def test_noise_is_normal_and_smooth() -> None:
    places = np.random.default_rng(0).uniform(-1, 1, (200, 2))
    places[:4] = [[-1, -1], [1, 1], [-1, 1], [0, 0]]
    near = places + 0.01
    drawn = np.array([smooth_noise(np.random.default_rng(seed), places) for seed in range(2000)])
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=0.12)
    np.testing.assert_allclose(drawn.var(axis=0), 1, atol=0.18)
    apart = smooth_noise(np.random.default_rng(0), near) - drawn[0]
    assert np.abs(apart).max() < 0.2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 22}, "multiple of 4"),
        ({"scenarios": ()}, "at least one"),
        ({"scenarios": ("water_2d", "water_3d")}, "one dimension.*2 in water_2d seed 0 and 3 in water_3d"),
        ({"shortest": 0.5}, "shortest"),
        ({"longest": float("inf")}, "longest"),
    ],
)
def test_what_a_network_cannot_be(change: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        TransportSpec(**{"scenarios": ("water_2d",), **change})  # type: ignore[arg-type]


def test_other_features_are_refused() -> None:
    plain = TransportSpec(scenarios=("water_2d",)).to_dict()
    assert TransportSpec.from_dict(plain, where="file").scenarios == ("water_2d",)
    with pytest.raises(ConfigError, match="file has transport features of version 0"):
        TransportSpec.from_dict({**plain, "features": 0}, where="file")

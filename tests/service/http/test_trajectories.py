"""A sketch comes in, its trajectory comes out, and the session stays as it is."""

from typing import Any

import numpy as np
import pytest
from tests.service.conftest import SMALL_SCENE, arrays_of

from hybridmpm import MpmSolver, Scene
from hybridmpm.control import Arrow, ControlledTrajectory, SketchResult, render_png
from hybridmpm_service.http.sketches import trajectory_arrays

NPZ = {"Accept": "application/x-npz"}
ARROW: dict[str, Any] = {"points": [[0.5, 0.5], [0.6, 0.55]], "kind": "arrow"}
ARROW_PNG = render_png(Arrow(np.array(ARROW["points"])))


def _positions(service: Any, path: str) -> np.ndarray[Any, Any]:
    return arrays_of(service.http.get(f"{path}/particles", headers=NPZ).content)["positions"]


def test_the_answer_describes_the_motion_and_the_session_stays(service: Any, path: str) -> None:
    service.http.post(f"{path}/advance", json={"frames": 4})
    before = _positions(service, path)
    answer = service.http.post(f"{path}/trajectories", json={"strokes": [ARROW], "frames": 45, "hold": 2})
    assert answer.status_code == 200
    body = answer.json()
    assert body["sketch"] == {"kind": "arrow", "points": ARROW["points"]}
    assert (body["method"], body["frames"], body["hold"], body["first_frame"]) == ("analytic", 45, 2, 4)
    assert body["frame_indices"] == [0, 10, 20, 30, 40, 47]
    assert (len(body["positions"]), len(body["force"])) == (6, 5)
    assert (len(body["centroids"]), len(body["mean_force"])) == (48, 47)
    np.testing.assert_allclose(body["target_displacement"], [0.1, 0.05])
    np.testing.assert_allclose(
        body["displacement"], np.subtract(body["centroids"][-1], body["centroids"][0]), atol=1e-12
    )
    assert body["needs"]["reachable"]
    assert body["reached"]["miss"] < 0.005
    assert body["reached"]["peak"] <= body["needs"]["cap"] * 1.001
    session = service.http.get(path).json()
    assert (session["frame"], session["control"]) == (4, None)
    assert np.array_equal(_positions(service, path), before)


@pytest.mark.parametrize("settings", [{}, {"method": "constant", "seed": 3}, {"cap": 6, "strength": 0.5}])
@pytest.mark.parametrize("as_png", [False, True])
def test_a_paused_session_follows_the_same_sketch_to_the_same_bits(
    service: Any, path: str, *, as_png: bool, settings: dict[str, Any]
) -> None:
    if as_png:
        form = {name: str(value) for name, value in settings.items()} | {"frames": "12"}
        body: dict[str, Any] = {"files": {"sketch": ("s.png", ARROW_PNG)}, "data": form}
    else:
        body = {"json": {"strokes": [ARROW], "frames": 12} | settings}
    answer = service.http.post(f"{path}/trajectories?stride=1", **body, headers=NPZ)
    assert answer.headers["content-type"] == "application/x-npz"
    motion = arrays_of(answer.content)
    assert motion["positions"].dtype == np.float32
    assert motion["frame_indices"].tolist() == list(range(13))
    assert service.http.post(f"{path}/sketches", **body).status_code == 200
    for frame in range(1, 13):
        moved = arrays_of(service.http.post(f"{path}/advance", json={}, headers=NPZ).content)
        assert np.array_equal(moved["positions"], motion["positions"][frame])
    assert service.http.get(path).json()["control"]["phase"] == "done"


@pytest.mark.parametrize(("method", "shape"), [("constant", (2,)), ("analytic", (12, 400, 2))])
def test_the_force_of_an_npz_gives_the_trajectory_in_the_library(
    service: Any, path: str, method: str, shape: tuple[int, ...]
) -> None:
    body = {"strokes": [ARROW], "frames": 12, "method": method}
    motion = arrays_of(service.http.post(f"{path}/trajectories?stride=1", json=body, headers=NPZ).content)
    solver = MpmSolver(Scene.parse(SMALL_SCENE))
    assert (len(motion["force"].shape), motion["force"].dtype) == (len(shape), np.float32)
    assert np.array_equal(solver.rollout(12, motion["force"]), motion["positions"])


def test_a_force_that_changes_is_thinned_as_the_positions_are() -> None:
    force = np.arange(7 * 3 * 2, dtype=np.float32).reshape(7, 3, 2)
    motion = ControlledTrajectory(
        ids=np.arange(3, dtype=np.uint64),
        positions=np.zeros((8, 3, 2), dtype=np.float32),
        force=force,
        mean_force=force.mean(axis=1, dtype=np.float64),
        target_displacement=np.zeros(2),
        displacement=np.zeros(2),
        centroids=np.zeros((8, 2)),
        first_frame=0,
        reached=SketchResult(inside=None, inside_drawn=None, miss=0.0, rms=0.0, peak=0.0),
        ending="done",
    )
    assert trajectory_arrays(motion, 3)["frame_indices"].tolist() == [0, 3, 6, 7]
    assert np.array_equal(trajectory_arrays(motion, 3)["force"], force[[0, 3, 6]])
    assert np.array_equal(trajectory_arrays(motion, 1)["force"], force)


@pytest.mark.parametrize("stride", ["0", "-1", "x"])
def test_a_bad_stride_is_named(service: Any, problem: Any, path: str, stride: str) -> None:
    answer = service.http.post(f"{path}/trajectories?stride={stride}", json={"strokes": [ARROW]})
    assert problem(answer, 422)["errors"][0]["field"] == "query.stride"

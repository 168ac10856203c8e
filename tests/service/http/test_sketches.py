"""A sketch comes in, its trajectory comes out, and the session follows it to the bit."""

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tests.service.conftest import SMALL_SCENE

from hybridmpm import MpmSolver, Scene
from hybridmpm.control import Arrow, ControlledTrajectory, Ellipse, Reached, render_png
from hybridmpm_service.http.sketch_answers import thinned_force, trajectory_arrays

NPZ = {"Accept": "application/x-npz"}
ARROW: dict[str, Any] = {"points": [[0.5, 0.5], [0.6, 0.55]], "kind": "arrow"}
ARROW_PNG = render_png(Arrow(np.array(ARROW["points"])))


def _arrays(content: bytes) -> dict[str, np.ndarray[Any, Any]]:
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return dict(file)


def _png(image: Image.Image) -> bytes:
    data = io.BytesIO()
    image.save(data, "PNG")
    return data.getvalue()


def _one_pixel() -> bytes:
    image = Image.new("RGB", (512, 512), "white")
    image.putpixel((9, 9), (255, 0, 0))
    return _png(image)


def test_the_answer_describes_the_controlled_motion(service: Any, path: str) -> None:
    service.http.post(f"{path}/advance", json={"frames": 4})
    answer = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 25})
    assert answer.status_code == 200
    body = answer.json()
    assert body["sketch"] == {"kind": "arrow", "points": ARROW["points"]}
    assert (body["frames"], body["first_frame"]) == (25, 4)
    assert body["frame_indices"] == [0, 10, 20, 25]
    assert len(body["positions"]) == 4
    assert len(body["centroids"]) == 26
    np.testing.assert_allclose(body["target_displacement"], [0.1, 0.05])
    np.testing.assert_allclose(body["displacement"], [0.1, 0.05], atol=5e-3)
    np.testing.assert_allclose(
        body["displacement"], np.subtract(body["centroids"][-1], body["centroids"][0]), atol=1e-12
    )
    session = service.http.get(path).json()
    assert session["control"] == {"kind": "arrow", "first_frame": 4, "frames_done": 0, "frames": 25}
    assert session["centroid"] == pytest.approx(body["centroids"][0])


@pytest.mark.parametrize("as_png", [False, True])
def test_the_session_follows_the_trajectory_bit_for_bit(service: Any, path: str, *, as_png: bool) -> None:
    address = f"{path}/sketches?stride=1"
    if as_png:
        answer = service.http.post(
            address, files={"sketch": ("s.png", ARROW_PNG)}, data={"frames": "12"}, headers=NPZ
        )
    else:
        answer = service.http.post(address, json={"strokes": [ARROW], "frames": 12}, headers=NPZ)
    assert answer.headers["content-type"] == "application/x-npz"
    plan = _arrays(answer.content)
    assert plan["positions"].dtype == np.float32
    assert plan["frame_indices"].tolist() == list(range(13))
    for frame in range(1, 13):
        moved = _arrays(service.http.post(f"{path}/advance", json={}, headers=NPZ).content)
        assert np.array_equal(moved["positions"], plan["positions"][frame])
    assert service.http.get(path).json()["control"] is None


def test_the_force_of_an_npz_gives_the_trajectory_in_the_library(service: Any, path: str) -> None:
    body = {"strokes": [ARROW], "frames": 12}
    plan = _arrays(service.http.post(f"{path}/sketches?stride=1", json=body, headers=NPZ).content)
    assert (plan["force"].shape, plan["force"].dtype) == ((2,), np.float32)
    solver = MpmSolver(Scene.parse(SMALL_SCENE))
    assert np.array_equal(solver.rollout(12, plan["force"]), plan["positions"])


def test_a_force_that_changes_is_thinned_as_the_positions_are() -> None:
    force = np.arange(7 * 3 * 2, dtype=np.float32).reshape(7, 3, 2)
    plan = ControlledTrajectory(
        ids=np.arange(3, dtype=np.uint64),
        positions=np.zeros((8, 3, 2), dtype=np.float32),
        force=force,
        mean_force=force.mean(axis=1, dtype=np.float64),
        target_displacement=np.zeros(2),
        displacement=np.zeros(2),
        centroids=np.zeros((8, 2)),
        first_frame=0,
        reached=Reached(inside=None, inside_drawn=None, miss=0.0, rms=0.0, peak=0.0),
        ending="done",
    )
    assert trajectory_arrays(plan, 3)["frame_indices"].tolist() == [0, 3, 6, 7]
    assert np.array_equal(thinned_force(plan, 3), force[[0, 3, 6]])
    assert np.array_equal(thinned_force(plan, 1), force)


def test_the_trajectory_is_followed_however_frames_are_asked_for(service: Any, path: str) -> None:
    answer = service.http.post(
        f"{path}/sketches?stride=40", json={"strokes": [ARROW], "frames": 40}, headers=NPZ
    )
    end = _arrays(answer.content)["positions"][-1]
    service.http.post(f"{path}/advance", json={"frames": 13})
    with service.stream(path) as stream:
        stream.send(type="step", frames=7)
        while stream.text("status")["session"]["frame"] < 20:
            pass
        assert stream.text("status")["session"]["control"]["frames_done"] == 20
        stream.send(type="speed", value=1.0)
        stream.send(type="play")
        while stream.text("status")["session"]["control"] is not None:
            pass
        stream.send(type="pause")
        while stream.text("status")["session"]["playing"]:
            pass
    frame = service.http.get(path).json()["frame"]
    twin = service.create()
    service.http.post(f"{twin}/sketches", json={"strokes": [ARROW], "frames": 40})
    reached = _arrays(service.http.post(f"{twin}/advance", json={"frames": 40}, headers=NPZ).content)[
        "positions"
    ]
    assert np.array_equal(reached, end)
    if frame > 40:
        service.http.post(f"{twin}/advance", json={"frames": frame - 40})
    both = [_arrays(service.http.get(f"{one}/particles", headers=NPZ).content) for one in (path, twin)]
    assert np.array_equal(both[0]["positions"], both[1]["positions"])


def test_an_oval_is_read_from_a_png(service: Any, path: str) -> None:
    oval = Ellipse(np.array([0.55, 0.45]), np.array([0.12, 0.08]), 0.3)
    answer = service.http.post(f"{path}/sketches", files={"sketch": ("s.png", render_png(oval))})
    body = answer.json()
    assert body["sketch"]["kind"] == "ellipse"
    assert body["frames"] == 100
    np.testing.assert_allclose(body["sketch"]["center"], [0.55, 0.45], atol=0.003)


def test_a_newer_sketch_replaces_an_older_one(service: Any, path: str) -> None:
    service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 30})
    service.http.post(f"{path}/advance", json={"frames": 5})
    service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 10})
    control = service.http.get(path).json()["control"]
    assert control == {"kind": "arrow", "first_frame": 5, "frames_done": 0, "frames": 10}


@pytest.mark.parametrize(
    ("body", "field", "message"),
    [
        ({"strokes": []}, "body.strokes", "at least 1"),
        ({"strokes": [ARROW, ARROW]}, "body.strokes", "at most 1"),
        ({"strokes": [{"points": [[0.5, 0.5]]}]}, "body.strokes[0].points", "at least 2"),
        ({"strokes": [{"points": [[0.5, 0.5], [1.5, 0.5]]}]}, "body.strokes[0].points[1][0]", "equal to 1"),
        ({"strokes": [{"points": [[0.5, 0.5], [0.5, 0.5]]}]}, "body.strokes[0].points", "at least 0.0039"),
        ({"strokes": [{"points": [[0.5, 0.5]] * 5000}]}, "body.strokes[0].points", "4096"),
        ({"strokes": [ARROW | {"widths": [3]}]}, "body.strokes[0]", "one per point"),
        ({"strokes": [ARROW], "frames": 0}, "body.frames", "equal to 1"),
        ({"strokes": [ARROW], "frames": 401}, "body.frames", "[1, 400]"),
        ({"strokes": [ARROW], "frames": "many"}, "body.frames", "integer"),
        ({"points": [[0.5, 0.5], [0.6, 0.5]]}, "body.strokes", "required"),
        ([], "body", "valid"),
    ],
)
def test_bad_strokes_are_refused_with_field_and_range(
    service: Any, problem: Any, path: str, *, body: Any, field: str, message: str
) -> None:
    found = problem(service.http.post(f"{path}/sketches", json=body), 422)
    assert found["errors"][0]["field"] == field
    assert message in found["errors"][0]["message"]
    assert service.http.get(path).json()["control"] is None


@pytest.mark.parametrize(
    "text", [b'{"strokes": [{"points": [[NaN, 0.5], [0.6, 0.5]]}]}', b'{"strokes"', b"", b"[" * 100_000]
)
def test_text_that_is_no_sketch_is_refused(service: Any, problem: Any, path: str, text: bytes) -> None:
    headers = {"Content-Type": "application/json"}
    found = problem(service.http.post(f"{path}/sketches", content=text, headers=headers), 422)
    assert found["errors"][0]["field"].startswith("body")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"GIF89a" + bytes(50), "not a PNG"),
        (ARROW_PNG[:300], "truncated"),
        (_png(Image.new("RGB", (512, 512), "white")), "blank"),
        (_png(Image.new("RGB", (1, 1), "red")), "16 to 2048"),
        (_png(Image.new("RGB", (4096, 4096), "white")), "16 to 2048"),
        (_one_pixel(), "at least 40"),
        (b"", "not a PNG"),
    ],
)
def test_a_file_that_is_no_sketch_is_refused_with_what_is_allowed(
    service: Any, problem: Any, path: str, data: bytes, message: str
) -> None:
    found = problem(service.http.post(f"{path}/sketches", files={"sketch": ("s.png", data)}), 422)
    assert found["errors"][0]["field"] == "body.sketch"
    assert message in found["errors"][0]["message"]
    assert service.http.get(path).json()["control"] is None


def test_a_file_that_is_too_large_is_413(service: Any, problem: Any, path: str) -> None:
    data = ARROW_PNG + bytes(1 << 20)
    found = problem(service.http.post(f"{path}/sketches", files={"sketch": ("s.png", data)}), 413)
    assert "1048576" in found["detail"]


@pytest.mark.parametrize(
    ("form", "field"),
    [
        ({"files": {"picture": ("s.png", ARROW_PNG)}}, "body.picture"),
        ({"files": {"sketch": (None, "text")}}, "body.sketch"),
        ({"files": {"sketch": ("s.png", ARROW_PNG)}, "data": {"frames": "-3"}}, "body.frames"),
        ({"files": {"sketch": ("s.png", ARROW_PNG)}, "data": {"frames": "9" * 500}}, "body.frames"),
        ({"files": {"sketch": ("s.png", ARROW_PNG)}, "data": {"frames": "0"}}, "body.frames"),
        ({"files": {"sketch": ("s.png", ARROW_PNG)}, "data": {"frames": "\u0663"}}, "body.frames"),
    ],
)
def test_a_bad_form_is_refused_with_its_field(
    service: Any, problem: Any, path: str, form: dict[str, Any], field: str
) -> None:
    found = problem(service.http.post(f"{path}/sketches", **form), 422)
    assert found["errors"][0]["field"] == field


def test_a_form_with_too_many_parts_or_no_boundary_is_refused(service: Any, problem: Any, path: str) -> None:
    files = [("sketch", ("a.png", ARROW_PNG)), ("sketch", ("b.png", ARROW_PNG))]
    problem(service.http.post(f"{path}/sketches", files=files), 400)
    headers = {"Content-Type": "multipart/form-data"}
    problem(service.http.post(f"{path}/sketches", content=b"--x--", headers=headers), 400)


@pytest.mark.parametrize("content_type", ["image/png", "text/plain", "application/x-www-form-urlencoded"])
def test_another_format_is_415_and_says_what_is_taken(
    service: Any, problem: Any, path: str, content_type: str
) -> None:
    answer = service.http.post(f"{path}/sketches", content=ARROW_PNG, headers={"Content-Type": content_type})
    assert "multipart/form-data" in problem(answer, 415)["detail"]


@pytest.mark.parametrize("stride", ["0", "-1", "x"])
def test_a_bad_stride_is_named(service: Any, problem: Any, path: str, stride: str) -> None:
    answer = service.http.post(f"{path}/sketches?stride={stride}", json={"strokes": [ARROW]})
    assert problem(answer, 422)["errors"][0]["field"] == "query.stride"

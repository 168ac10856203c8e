"""A sketch steers the session, or its trajectory is returned; what cannot be followed is refused in words."""

import io
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tests.service.conftest import SMALL_SCENE, arrays_of, problem

from hybridmpm import MpmSolver, Scene, replay
from hybridmpm.control import METHODS, Arrow, Ellipse, Law, Task, render_png
from hybridmpm.simulator import Simulator

ARROW: dict[str, Any] = {"points": [[0.5, 0.5], [0.6, 0.55]], "kind": "arrow"}
ARROW_PNG = render_png(Arrow(np.array(ARROW["points"])))


def _png(image: Image.Image) -> bytes:
    data = io.BytesIO()
    image.save(data, "PNG")
    return data.getvalue()


def _one_pixel() -> bytes:
    image = Image.new("RGB", (512, 512), "white")
    image.putpixel((9, 9), (255, 0, 0))
    return _png(image)


def test_the_force_is_that_of_the_next_frame(service: Any, path: str) -> None:
    nothing = service.http.get(f"{path}/force").json()
    assert (nothing["frame"], nothing["points"], nothing["force"]) == (0, [], [])
    constant = {"strokes": [ARROW], "frames": 45, "method": "constant"}
    needed = service.http.post(f"{path}/trajectories?stride=10000", json=constant).json()["mean_force"][0]
    service.http.post(f"{path}/sketches", json=constant)
    field = service.http.get(f"{path}/force").json()
    assert len(field["points"]) == len(field["force"]) > 10
    np.testing.assert_allclose(field["force"], [needed] * len(field["force"]), atol=0.01)
    positions = np.array(service.http.get(f"{path}/particles").json()["positions"])
    cells = {tuple(cell) for cell in np.floor(positions / field["cell"]).astype(int)}
    assert {tuple(cell) for cell in np.floor(np.array(field["points"]) / field["cell"]).astype(int)} == cells
    service.http.post(f"{path}/advance", json={"frames": 3})
    assert service.http.get(f"{path}/force").json()["frame"] == 3
    assert service.http.get(path).json()["control"]["frames_done"] == 3


@pytest.mark.parametrize("who", [0, "water", {"particle": 5}, {"points": [[0.1, 0.1], [0.9, 0.9]]}, None])
def test_who_is_led_can_be_chosen(service: Any, path: str, who: Any) -> None:
    count = len(service.http.get(f"{path}/particles").json()["positions"])
    answer = service.http.post(f"{path}/trajectories", json={"strokes": [ARROW], "frames": 2, "who": who})
    assert answer.status_code == 200, answer.text
    led = len(answer.json()["positions"][0])
    assert led == count if not isinstance(who, dict) or "particle" in who else 0 < led < count
    steered = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 45, "who": who})
    assert steered.status_code == 200, steered.text
    service.http.post(f"{path}/advance", json={"frames": 2})
    log = service.http.get(f"{path}/log").json()
    again = service.http.post("/v1/sessions", json={"log": log})
    assert again.status_code == 201, again.text
    assert again.json()["notice"] is None


def test_a_shape_and_then_goals_in_turn_steer_and_are_kept_in_the_log(service: Any, path: str) -> None:
    outlines = [[[0.4, 0.4], [0.6, 0.4], [0.6, 0.5], [0.4, 0.5]]]
    shape = {"kind": "shape", "outlines": outlines}
    steered = service.http.post(f"{path}/sketches", json={"sketch": shape, "frames": 45, "hold": 2})
    assert steered.status_code == 200, steered.text
    assert steered.json()["sketch"] == shape
    assert steered.json()["keyframes"] is None
    lines = np.array(steered.json()["goal"]["outlines"])
    assert lines.shape == (1, 4, 2)
    scale = steered.json()["needs"]["scale"]
    np.testing.assert_allclose(np.ptp(lines[0], axis=0), scale * np.array([0.2, 0.1]), atol=2e-3)
    service.http.post(f"{path}/advance", json={"frames": 10})
    assert service.http.get(path).json()["control"]["kind"] == "shape"
    goals = [
        {"sketch": shape, "frames": 8, "who": "water"},
        {"strokes": [ARROW], "frames": 6, "hold": 2, "who": {"particle": 0}},
        {"strokes": [ARROW], "frames": 4},
    ]
    answer = service.http.post(f"{path}/sketches", json={"keyframes": goals, "cap": 12})
    assert answer.status_code == 200, answer.text
    body = answer.json()
    assert [(one["start"], one["frames"], one["hold"]) for one in body["keyframes"]] == [
        (0, 8, 0),
        (8, 6, 2),
        (16, 4, 0),
    ]
    assert [one["sketch"]["kind"] for one in body["keyframes"]] == ["shape", "arrow", "arrow"]
    assert (body["frames"], body["needs"]["cap"]) == (20, 12)
    seen = []
    for frames in (5, 5, 8):
        control = service.http.post(f"{path}/advance", json={"frames": frames}).json()["control"]
        seen.append((control["kind"], control["keyframe"], control["phase"]))
    assert [one[:2] for one in seen] == [("shape", 0), ("arrow", 1), ("arrow", 2)]
    assert service.http.get(f"{path}/sketches").json()["sketch"]["kind"] == "arrow"
    log = service.http.get(f"{path}/log").json()
    assert [len(one["keyframes"] or ()) for one in log["inputs"]] == [0, 3]
    again = service.http.post("/v1/sessions", json={"log": log})
    assert again.status_code == 201, again.text
    assert again.json()["notice"] is None
    assert replay(log).digest() == log["digest"]
    twin = service.http.post(f"{path}/fork").json()["links"]["self"]
    ends = [service.http.post(f"{one}/advance", json={"frames": 2}).json() for one in (path, twin)]
    assert ends[0]["control"]["phase"] == ends[1]["control"]["phase"] == "done"
    assert len({service.http.get(f"{one}/log").json()["digest"] for one in (path, twin)}) == 1


def test_what_is_unwise_is_said(service: Any, path: str) -> None:
    turn = np.deg2rad(90 + 144 * np.arange(5))
    star = 0.5 + 0.25 * np.column_stack([np.cos(turn), np.sin(turn)])
    bar = [[0.2, 0.5], [0.8, 0.5], [0.8, 0.51], [0.2, 0.51]]
    far = [[0.65, 0.65], [0.85, 0.65], [0.85, 0.85], [0.65, 0.85]]
    for outline, frames, text in (
        (star.tolist(), 200, "lines of the shape cross: what they enclose an odd number of times is filled"),
        (bar, 200, "100 % of the shape is thinner than 4 grid cells, 12.5 cm: draw it wider"),
        (far, 12, "12 frames take "),
        (far, 12, " frames would do"),
    ):
        body = {"sketch": {"kind": "shape", "outlines": [outline]}, "frames": frames}
        needs = service.http.post(f"{path}/sketches", json=body).json()["needs"]
        assert text in needs["text"]
        assert any(
            text in said for said in [*needs["notes"], *(one["message"] for one in needs["obstructions"])]
        )


TETRAHEDRON: dict[str, Any] = {
    "kind": "solid",
    "vertices": [[0.4, 0.4, 0.4], [0.7, 0.4, 0.4], [0.4, 0.7, 0.4], [0.4, 0.4, 0.7]],
    "triangles": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
}


def test_a_solid_steers_in_space_and_is_kept_in_the_log(service: Any) -> None:
    body = {"shape": "box", "lower": [0.3, 0.3, 0.3], "upper": [0.5, 0.5, 0.5], "material": "water"}
    path = service.create({"dim": 3, "resolution": 16, "bodies": [body]})
    answer = service.http.post(f"{path}/sketches", json={"sketch": TETRAHEDRON, "frames": 120})
    assert answer.status_code == 200, answer.text
    assert answer.json()["sketch"] == TETRAHEDRON
    assert answer.json()["needs"]["obstructions"][0]["message"].endswith("make it thicker")
    (line,) = answer.json()["goal"]["outlines"]
    assert np.array(line).shape == (3, 3)
    control = service.http.post(f"{path}/advance", json={"frames": 120}).json()["control"]
    assert (control["kind"], control["phase"]) == ("solid", "done")
    assert control["inside"] > 0.7
    log = service.http.get(f"{path}/log").json()
    assert service.http.post("/v1/sessions", json={"log": log}).json()["notice"] is None


@pytest.mark.parametrize(
    ("request_", "field", "text"),
    [
        ({}, "body", "exactly one of strokes, sketch and keyframes must be given, got none of them"),
        ({"strokes": [ARROW], "keyframes": [{"strokes": [ARROW]}]}, "body", "got strokes and keyframes"),
        ({"keyframes": [{"strokes": [ARROW]}], "hold": 3}, "body.hold", "belongs to each of the keyframes"),
        ({"keyframes": [{"frames": 5}]}, "body.keyframes[0]", "exactly one of strokes and sketch"),
        (
            {"sketch": {"kind": "shape"}},
            "body.sketch",
            "has a field that its kind does not have, or lacks one",
        ),
        (
            {"sketch": {"kind": "shape", "outlines": [[[0.1, 0.1], [0.2, 0.2]]]}},
            "body.sketch",
            "outlines[0]: a closed line has at least 3 points, got 2",
        ),
        (
            {"keyframes": [{"sketch": {"kind": "arrow", "points": [[0.1, 0.1], [3.0, 0.2]]}}]},
            "body.keyframes[0].sketch",
            "points[1]: must be two numbers in [0, 1]",
        ),
        (
            {"sketch": TETRAHEDRON | {"triangles": TETRAHEDRON["triangles"][1:]}},
            "body.sketch.triangles",
            "should have at least 4 items",
        ),
        (
            {"sketch": TETRAHEDRON | {"triangles": [*TETRAHEDRON["triangles"][1:], [0, 0, 1]]}},
            "body.sketch",
            "triangles must be closed, but have 4 open edges: vertices 0 and 0, (0.4, 0.4, 0.4) to",
        ),
        ({"sketch": TETRAHEDRON}, None, "a solid is a goal in 3D only: in 2D draw a shape"),
        ({"keyframes": [{"strokes": [ARROW], "frames": 9_999}] * 3}, None, "at most 400 are allowed"),
    ],
)
def test_what_is_no_sketch_and_no_keyframes_is_refused(
    service: Any, path: str, request_: dict[str, Any], field: str | None, text: str
) -> None:
    answer = service.http.post(f"{path}/sketches", json=request_)
    assert answer.status_code == 422
    assert text in answer.text
    if field is not None:
        assert [one["field"] for one in answer.json()["errors"]] == [field]


def test_a_choice_of_nobody_is_refused(service: Any, path: str) -> None:
    for who, text in (("sand", "chooses none"), (7, "who must be"), ({"particle": -1}, "greater than")):
        answer = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "who": who})
        assert 400 <= answer.status_code < 500
        assert text in answer.text


def test_a_sketch_steers_from_the_next_frame_on(service: Any, path: str) -> None:
    service.http.post(f"{path}/advance", json={"frames": 4})
    answer = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 45, "hold": 3})
    assert answer.status_code == 200
    body = answer.json()
    assert body["sketch"] == {"kind": "arrow", "points": ARROW["points"]}
    assert (body["number"], body["method"]) == (1, "learned")
    assert "led back nearer than guidance" in body["reason"]
    assert (body["frames"], body["hold"], body["first_frame"], body["drawn_frame"]) == (45, 3, 4, 4)
    assert not {"positions", "force", "centroids"} & set(body)
    needs = body["needs"]
    assert 0 < needs["rms"] <= needs["acceleration"] <= needs["cap"] == 15
    assert (needs["reachable"], needs["obstructions"]) == (True, [])
    assert "g in 45 frames" in needs["text"]
    start = service.http.get(path).json()["centroid"]
    np.testing.assert_allclose(body["goal"]["path"], [start, np.add(start, [0.1, 0.05])], atol=1e-4)
    assert (body["goal"]["drawn"], body["goal"]["region"]) == (None, None)
    control = {
        "number": 1,
        "kind": "arrow",
        "phase": "steering",
        "method": "learned",
        "first_frame": 4,
        "frames_done": 0,
        "frames": 45,
        "hold": 3,
        "keyframe": None,
        "inside": None,
        "inside_drawn": None,
        "miss": None,
    }
    assert service.http.get(path).json()["control"] == control
    end = service.http.post(f"{path}/advance", json={"frames": 45}).json()
    assert end["control"] == control | {
        "phase": "holding",
        "frames_done": 45,
        "miss": pytest.approx(0, abs=0.005),
    }
    np.testing.assert_allclose(end["centroid"], np.add(start, [0.1, 0.05]), atol=0.005)
    service.http.post(f"{path}/advance", json={"frames": 10})
    control = service.http.get(path).json()["control"]
    assert (control["phase"], control["frames_done"]) == ("done", 48)


def test_an_oval_is_answered_as_drawn_and_as_grown(service: Any, path: str) -> None:
    angles = np.linspace(0, 2 * np.pi, 40)
    points = np.stack([0.5 + 0.05 * np.cos(angles), 0.14 + 0.05 * np.sin(angles)], axis=1).tolist()
    body = service.http.post(f"{path}/sketches", json={"strokes": [{"points": points}]}).json()
    assert body["sketch"]["kind"] == "ellipse"
    assert body["frames"] == body["needs"]["suggested_frames"]
    assert body["needs"]["scale"] > 1
    drawn, grown = (np.array(body["goal"][name]) for name in ("drawn", "region"))
    assert np.ptp(drawn[:, 0]) == pytest.approx(0.1, abs=0.005)
    assert np.ptp(grown[:, 0]) == pytest.approx(0.1 * body["needs"]["scale"], abs=0.005)
    assert min(drawn[:, 1].min(), grown[:, 1].min()) == pytest.approx(0.1)
    assert body["needs"]["taken"] > 0
    end = service.http.post(f"{path}/advance", json={"frames": body["frames"]}).json()["control"]
    assert end["inside"] > 0.85
    assert 0 < end["inside_drawn"] < end["inside"]


def test_a_goal_out_of_reach_is_described_and_still_aimed_at(service: Any, path: str) -> None:
    body = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 5, "cap": 3}).json()
    assert not body["needs"]["reachable"]
    assert [one["reason"] for one in body["needs"]["obstructions"]] == ["time"]
    assert "frames would do" in body["needs"]["obstructions"][0]["message"]
    assert service.http.get(path).json()["control"]["phase"] == "out_of_reach"


def test_an_oval_where_no_fluid_can_be_is_refused(service: Any, path: str) -> None:
    points = [[0.02, 0.02], [0.06, 0.02], [0.06, 0.06], [0.02, 0.06], [0.02, 0.02]]
    answer = service.http.post(f"{path}/sketches", json={"strokes": [{"points": points, "kind": "ellipse"}]})
    found = problem(answer, 422)
    assert found["type"] == "urn:hybridmpm:problem:bad-sketch"
    assert "draw the goal where the fluid can be" in found["detail"]
    assert service.http.get(path).json()["control"] is None


def test_a_playing_session_goes_on_and_is_steered(service: Any, path: str) -> None:
    with service.stream(path) as stream:
        stream.send(type="speed", value=1.0)
        stream.send(type="play")
        while stream.text("status")["session"]["frame"] < 5:
            pass
        body = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 40}).json()
        assert 5 <= body["drawn_frame"] <= body["first_frame"]
        while (control := stream.text("status")["session"]["control"]) is None or control["phase"] != "done":
            pass
        assert (control["first_frame"], control["frames_done"]) == (body["first_frame"], 40)


def test_viewers_see_the_preparation_of_a_sketch(service: Any, path: str) -> None:
    seen = []
    with service.stream(path) as stream:
        stream.text("status")
        service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 8, "method": "constant"})
        while not seen or seen[-1] not in {"steering", "out_of_reach"}:
            control = stream.text("status")["session"]["control"]
            seen.append(None if control is None else control["phase"])
    assert "preparing" in seen


def test_an_oval_is_read_from_a_png(service: Any, path: str) -> None:
    oval = Ellipse(np.array([0.55, 0.45]), np.array([0.12, 0.08]), 0.3)
    form = {
        "frames": "60",
        "hold": "5",
        "cap": "7.5",
        "strength": "0.5",
        "fill": "shrink",
        "seed": "4",
        "who": "water",
    }
    files = {"sketch": ("s.png", render_png(oval))}
    answer = service.http.post(f"{path}/sketches", files=files, data=form | {"method": "analytic"})
    assert answer.status_code == 200, answer.text
    body = answer.json()
    assert body["sketch"]["kind"] == "ellipse"
    assert (body["frames"], body["hold"], body["needs"]["cap"]) == (60, 5, 3.75)
    assert body["reason"] == "chosen by the caller"
    np.testing.assert_allclose(body["sketch"]["center"], [0.55, 0.45], atol=0.003)


def test_a_sketch_can_be_deleted(service: Any, path: str) -> None:
    assert service.http.get(f"{path}/sketches").json() is None
    made = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 30}).json()
    assert service.http.get(f"{path}/sketches").json() == made
    assert service.http.delete(f"{path}/sketches").status_code == 204
    assert service.http.get(f"{path}/sketches").json() is None
    assert service.http.get(path).json()["control"] is None
    assert service.http.delete(f"{path}/sketches").status_code == 204


class _Endless:
    """A method that plans until the planning is given up."""

    name = "constant"

    def plan(self, simulator: Simulator, task: Task) -> Law:  # noqa: ARG002 - a method's surface
        while True:
            task.on_frame()
            time.sleep(0.001)


def test_a_sketch_that_a_newer_one_replaces_while_it_is_prepared_is_409(
    service: Any, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(METHODS, "constant", _Endless())
    slow = {"strokes": [ARROW], "frames": 40, "method": "constant"}
    with ThreadPoolExecutor() as pool:
        first = pool.submit(service.http.post, f"{path}/sketches", json=slow)
        with service.stream(path) as stream:
            while stream.text("status")["session"]["control"] is None:
                pass
        second = service.http.post(f"{path}/sketches", json={"strokes": [ARROW], "frames": 40})
        assert second.json()["number"] == 2
        found = problem(first.result(), 409)
    assert found["type"] == "urn:hybridmpm:problem:sketch-dropped"
    assert "a newer sketch has replaced" in found["detail"]
    assert service.http.get(path).json()["control"]["number"] == 2


@pytest.mark.parametrize(
    ("body", "field", "message"),
    [
        ({"strokes": [ARROW, ARROW]}, "body.strokes", "at most 1"),
        ({"strokes": [{"points": [[0.5, 0.5], [1.5, 0.5]]}]}, "body.strokes[0].points[1]", "in [0, 1], got"),
        (
            {"strokes": [{"points": [[0.5, 0.5], [0.5, 0.5]]}]},
            "body.strokes[0].points",
            "all are in one place",
        ),
        ({"strokes": [ARROW | {"widths": [3]}]}, "body.strokes[0]", "one per point"),
        ({"strokes": [ARROW], "frames": 401}, "body.frames", "[1, 400]"),
        ({"strokes": [ARROW], "frames": 400, "hold": 1}, "body.frames", "[1, 399] for this session with"),
        ({"strokes": [ARROW], "hold": 400}, "body.hold", "[0, 399]"),
        ({"strokes": [ARROW], "method": "magic"}, "body.method", "auto, none, constant, analytic"),
        ({"strokes": [ARROW], "cap": 0}, "body.cap", "greater than 0"),
        ({"strokes": [ARROW], "fill": "half"}, "body.fill", "'even' or 'shrink'"),
        ({"strokes": [ARROW], "resolution": 32}, "body.resolution", "not permitted"),
        ({"strokes": [ARROW], "frames": "many"}, "body.frames", "integer"),
        ({"points": [[0.5, 0.5], [0.6, 0.5]]}, "body.points", "not permitted"),
    ],
)
def test_bad_strokes_are_refused_with_field_and_range(
    service: Any, path: str, *, body: Any, field: str, message: str
) -> None:
    for suffix in ("sketches", "trajectories"):
        found = problem(service.http.post(f"{path}/{suffix}", json=body), 422)
        assert found["errors"][0]["field"] == field
        assert message in found["errors"][0]["message"]
    assert service.http.get(path).json()["control"] is None


@pytest.mark.parametrize(
    "text", [b'{"strokes": [{"points": [[NaN, 0.5], [0.6, 0.5]]}]}', b'{"strokes"', b"", b"[" * 100_000]
)
def test_text_that_is_no_sketch_is_refused(service: Any, path: str, text: bytes) -> None:
    headers = {"Content-Type": "application/json"}
    found = problem(service.http.post(f"{path}/sketches", content=text, headers=headers), 422)
    assert found["errors"][0]["field"].startswith("body")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: b"GIF89a" + bytes(50), "no PNG, JPEG or WebP"),
        (lambda: ARROW_PNG[:300], "truncated"),
        (lambda: _png(Image.new("RGB", (512, 512), "white")), "blank"),
        (lambda: _png(Image.new("RGB", (4097, 4097), "white")), "16 to 4096"),
        (_one_pixel, "at least 40"),
    ],
)
def test_a_file_that_is_no_sketch_is_refused_with_what_is_allowed(
    service: Any, path: str, make: Callable[[], bytes], message: str
) -> None:
    found = problem(service.http.post(f"{path}/sketches", files={"sketch": ("s.png", make())}), 422)
    assert found["errors"][0]["field"] == "body.sketch"
    assert message in found["errors"][0]["message"]
    assert service.http.get(path).json()["control"] is None


def test_a_file_that_is_too_large_is_413(service: Any, path: str) -> None:
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
        ({"files": {"sketch": ("s.png", ARROW_PNG)}, "data": {"cap": "nan"}}, "body.cap"),
        ({"files": {"sketch": ("s.png", ARROW_PNG)}, "data": {"strokes": "[]"}}, "body.strokes"),
        ({"files": {"sketch": ("s.png", ARROW_PNG)}, "data": {"frames": "\u0663"}}, "body.frames"),
    ],
)
def test_a_bad_form_is_refused_with_its_field(
    service: Any, path: str, form: dict[str, Any], field: str
) -> None:
    found = problem(service.http.post(f"{path}/sketches", **form), 422)
    assert found["errors"][0]["field"] == field


def test_a_form_with_too_many_parts_or_no_boundary_is_refused(service: Any, path: str) -> None:
    files = [("sketch", ("a.png", ARROW_PNG)), ("sketch", ("b.png", ARROW_PNG))]
    problem(service.http.post(f"{path}/sketches", files=files), 400)
    headers = {"Content-Type": "multipart/form-data"}
    problem(service.http.post(f"{path}/sketches", content=b"--x--", headers=headers), 400)


@pytest.mark.parametrize("content_type", ["image/png", "text/plain", "application/x-www-form-urlencoded"])
def test_another_format_is_415_and_names_the_accepted_ones(
    service: Any, path: str, content_type: str
) -> None:
    answer = service.http.post(f"{path}/sketches", content=ARROW_PNG, headers={"Content-Type": content_type})
    assert "multipart/form-data" in problem(answer, 415)["detail"]


NPZ = {"Accept": "application/x-npz"}


def _positions(service: Any, path: str) -> np.ndarray[Any, Any]:
    return arrays_of(service.http.get(f"{path}/particles", headers=NPZ).content)["positions"]


def test_the_answer_describes_the_motion_and_the_session_stays(service: Any, path: str) -> None:
    service.http.post(f"{path}/advance", json={"frames": 4})
    before = _positions(service, path)
    answer = service.http.post(f"{path}/trajectories", json={"strokes": [ARROW], "frames": 45, "hold": 2})
    assert answer.status_code == 200
    body = answer.json()
    assert body["sketch"] == {"kind": "arrow", "points": ARROW["points"]}
    assert (body["method"], body["frames"], body["hold"], body["first_frame"]) == ("learned", 45, 2, 4)
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


@pytest.mark.parametrize("stride", ["0", "-1", "x"])
def test_a_bad_stride_is_named(service: Any, path: str, stride: str) -> None:
    answer = service.http.post(f"{path}/trajectories?stride={stride}", json={"strokes": [ARROW]})
    assert problem(answer, 422)["errors"][0]["field"] == "query.stride"

"""The page's pure modules, run in the browser that will run them."""

import base64
import math
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Error, Page
from tests.python.control.hand_drawn import SKETCHES

import hybridmpm_service
from hybridmpm import BallObstacle, BoxObstacle, HalfSpaceObstacle, Motion, SegmentObstacle
from hybridmpm.control import classify_stroke
from hybridmpm.stream_frames import Frame, Population, Poses, decode, encode

from .conftest import LiveService

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def page(browser: Browser, service: LiveService) -> Iterator[Page]:
    """Open a page of the service's origin, whose modules may be imported."""
    opened = browser.new_page()
    opened.goto(service.url + "/icon.svg")
    yield opened
    opened.close()


def _call(page: Page, module: str, function: str, *arguments: Any) -> Any:
    script = "async ([m, f, a]) => (await import(m))[f](...a)"
    return page.evaluate(script, [f"/{module}", function, list(arguments)])


def _decode(page: Page, message: bytes) -> Any:
    script = """async (text) => {
      const { decodeFrame } = await import("/frames.js");
      const frame = decodeFrame(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
      const list = (numbers) => (numbers === null ? null : [...numbers]);
      const { positions, ids, types, poses } = frame;
      const lists = { positions: list(positions), ids: list(ids), types: list(types), poses: list(poses) };
      return { ...frame, ...lists };
    }"""
    return page.evaluate(script, base64.b64encode(message).decode())


def _frame(magic: bytes = b"HMPM", version: int = 3, count: int = 2, dim: int = 3) -> bytes:
    header = struct.pack("<4sBBHQdIBBH", magic, version, 1, 1, 2**40 + 7, 0.125, count, dim, 1, 250)
    return header + struct.pack("<6H", 0, 1, 2, 65533, 65534, 65535)


def test_a_slow_line_is_one_that_brings_fewer_frames_than_are_due(page: Page) -> None:
    script = """async () => {
      const { Line } = await import("/net/line.js");
      const line = new Line();
      const after = (from, to, every, pace) => {
        for (let now = from; now < to; now += every) line.take(now);
        return line.slow(to, pace);
      };
      return [
        after(0, 1000, 100, 100), // for too short a time to say
        after(1000, 3000, 100, 100),
        after(3000, 5000, 20, 100),
        after(5000, 7000, 100, 10),
        after(7000, 9000, 100, 0),
        after(9000, 10000, 500, 100),
      ];
    }"""
    assert page.evaluate(script) == [None, {"come": 9.5, "due": 60}, None, None, None, None]


def test_scenes_are_drawn_in_lengths_of_their_world(page: Page) -> None:
    obstacle = {
        "shape": "ball",
        "center": [2.0, 0.5],
        "radius": 0.4,
        "motion": {"velocity": [1, 0], "period": 3},
    }
    emitter = {"lower": [0, 0.2], "upper": [0, 0.4], "velocity": [2, 0], "start": 1, "stop": 4}
    walls = {"lower": [0, 0], "upper": [4, 1]}
    scene = {
        "dim": 2,
        "world": {"size": [4, 1]},
        "walls": walls,
        "obstacles": [obstacle],
        "emitters": [emitter],
    }
    assert _call(page, "frames.js", "lengthOf", scene) == 4
    assert _call(page, "frames.js", "lengthOf", {"dim": 3}) == 1
    drawn = _call(page, "stage/units.js", "scaled", scene, 0.25)
    assert drawn["walls"] == {"lower": [0, 0], "upper": [1, 0.25]}
    moved = obstacle | {"center": [0.5, 0.125], "radius": 0.1, "motion": {"velocity": [0.25, 0], "period": 3}}
    assert drawn["obstacles"] == [moved]
    assert drawn["emitters"] == [emitter | {"lower": [0, 0.05], "upper": [0, 0.1], "velocity": [0.5, 0]}]
    assert _call(page, "stage/units.js", "scaled", scene, 1) == scene


@pytest.mark.parametrize("count", [0, 1, 7, 50])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_page_reads_what_the_service_writes(page: Page, count: int, dim: int) -> None:
    rng = np.random.default_rng(count + dim)
    ids = np.sort(rng.choice(2**32, count, replace=False)).astype(np.uint32)
    types = rng.choice(np.array([3, 5, 6, 7], np.uint8), count)
    rigid = Poses.of(rng.normal(size=(3, 13)), dim) if count % 2 else None
    for population in (None, Population(ids=ids, types=types)):
        written = Frame(
            number=2**50 + 1,
            time=0.1,
            solver_ms=1.25,
            steered=population is None,
            positions=rng.random((count, dim), dtype=np.float32),
            population=population,
            rigid=rigid,
        )
        message = encode(written)
        read, known = _decode(page, message), decode(message)
        assert (read["frame"], read["time"], read["solverMs"]) == (known.number, known.time, known.solver_ms)
        assert (read["count"], read["dim"], read["steered"]) == (count, dim, known.steered)
        np.testing.assert_allclose(
            np.array(read["positions"]).reshape(count, dim) / 65535, known.positions, atol=1e-7
        )
        assert read["ids"] == (None if population is None else ids.tolist())
        assert read["types"] == (None if population is None else types.tolist())
        rows = None if rigid is None else np.column_stack([rigid.center, rigid.rotation])
        assert read["poses"] == (None if rows is None else pytest.approx(rows.ravel()))
        if count:
            with pytest.raises(Error, match="bytes"):
                _decode(page, message[:-1])


@pytest.mark.parametrize("dim", [2, 3])
def test_a_tab_that_leads_writes_what_the_service_writes(page: Page, dim: int) -> None:
    rng = np.random.default_rng(dim)
    positions, numbers = rng.random((5, dim), dtype=np.float32), rng.normal(size=(2, 13))
    numbers[:, 3:7] /= np.linalg.norm(numbers[:, 3:7], axis=1, keepdims=True)
    written = Frame(number=7, time=0.5, solver_ms=1.25, steered=False, positions=positions, rigid=None)
    script = """async ([positions, bodies, dim]) => {
      const { encodeFrame } = await import("/net/lead-frames.js");
      const given = { frame: 7, time: 0.5, solverMs: 1.25, isSteered: false, length: 1, population: null };
      const places = Float32Array.from(positions.flat());
      const numbers = bodies === null ? null : Float64Array.from(bodies.flat());
      const frame = encodeFrame({ ...given, dim, positions: places, bodies: numbers });
      return btoa(String.fromCharCode(...new Uint8Array(frame)));
    }"""

    def sent(bodies: list[list[float]] | None) -> bytes:
        return base64.b64decode(page.evaluate(script, [positions.tolist(), bodies, dim]))

    assert sent(None) == encode(written)
    read, known = decode(sent(numbers.tolist())).rigid, Poses.of(numbers, dim)
    assert read is not None
    assert read.center == pytest.approx(known.center)
    assert read.rotation == pytest.approx(known.rotation, abs=1e-6)


@pytest.mark.parametrize(
    "message",
    [
        b"",
        _frame()[:31],
        _frame()[:-1],
        _frame(magic=b"HTTP"),
        _frame(version=2),
        _frame(version=4),
        _frame(count=3),
        _frame(dim=4),
    ],
)
def test_foreign_frame_is_refused(page: Page, message: bytes) -> None:
    with pytest.raises(Error, match=r"frame|bytes"):
        _decode(page, message)


_EACH_CALL = """async () => {
  const { Client, Job, Session } = await import("/client.js");
  const calls = [];
  const lists = ["sessions", "jobs", "scenarios", "models", "decisions", "positions", "velocities", "types"];
  const answer = { id: "ID", ...Object.fromEntries(lists.map((name) => [name, []])) };
  const fetch = async (address, { method, body, headers }) => {
    const sent = Object.keys(typeof body === "string" ? JSON.parse(body) : {});
    calls.push([method, address.pathname, [...address.searchParams.keys(), ...sent], headers]);
    return Response.json(answer);
  };
  const client = new Client("http://service.example/below", { key: "KEY", fetch });
  const session = new Session(client, { id: "ID", dim: 2 });
  const job = new Job(client, { id: "ID" });
  const stroke = { points: [[0.3, 0.3], [0.5, 0.5]], kind: "arrow" };
  const methods = [
    [client, {
      ready: [], scenarios: [], scenario: ["NAME", 1], models: [], plan: [{ scenario: "NAME", budget_ms: 1 }],
      check: [{ scene: {} }], create: [{ scenario: "NAME", seed: 1, coarse: "1/16" }], sessions: [],
      session: ["ID"], makeDataset: [{ scenario: "NAME", trajectories: 1 }], jobs: [], job: ["ID"],
      outlines: [{ text: "O", center: [0.5, 0.5], height: 0.3 }],
      shape: [new Blob(["x"]), "svg", { height: 0.3, x: 0.5 }],
    }],
    [session, {
      refresh: [], advance: [2], particles: [], particlesFile: ["ply"], surfaceFile: ["glb"], startFile: [],
      fork: [], log: [], decisions: [], steer: [stroke, { hold: 3 }], sketch: [], release: [], force: [],
      pressure: [], ways: [],
      trace: [stroke.points, {}, { stride: 2 }], record: [{ frames: 3, format: "gif" }],
      link: [{ seconds: 9 }], takeLinksBack: [], delete: [{ after: 60 }],
    }],
    [job, { refresh: [], result: [], delete: [] }],
  ];
  const shape = { kind: "shape", outlines: [[[0.3, 0.3], [0.5, 0.3], [0.4, 0.5]]] };
  await session.steer(shape);
  await session.steer([{ sketch: shape, frames: 20 }, { strokes: [stroke] }], { cap: 10 });
  for (const [one, each] of methods) {
    for (const [name, given] of Object.entries(each)) await one[name](...given);
  }
  const named = methods.map(([, each]) => Object.keys(each));
  const names = [Client, Session, Job].map((kind) => Object.getOwnPropertyNames(kind.prototype));
  return { calls, named, names };
}"""


def test_the_client_has_each_call_of_the_service_and_nothing_else(page: Page, service: LiveService) -> None:
    """Calls and fields by the OpenAPI document, and methods by the declared types."""
    made = page.evaluate(_EACH_CALL)
    document = service.get("/openapi.json")
    ids = {"{session_id}": "ID", "{name}": "NAME", "{job_id}": "ID"}
    there = {}
    for path, methods in document["paths"].items():
        place = "/".join(ids.get(part, part) for part in path.split("/"))
        there.update({(method.upper(), place): operation for method, operation in methods.items()})
    calls = {(method, path.removeprefix("/below")) for method, path, _, _ in made["calls"]}
    assert all(path.startswith("/below/") for _, path, _, _ in made["calls"])
    assert calls == set(there) - {("GET", "/livez")}  # which supervisors request
    for method, path, fields, headers in made["calls"]:
        assert headers["Authorization"] == "Bearer KEY"
        operation = there[method, path.removeprefix("/below")]
        content = operation.get("requestBody", {}).get("content", {})
        schema = content.get("application/json", {"schema": {}})["schema"]
        schema = document["components"]["schemas"].get(schema.get("$ref", "").rpartition("/")[2], {})
        known = {one["name"] for one in operation.get("parameters", ())} | set(schema.get("properties", ()))
        assert set(fields) <= known, (method, path)
    steered = {one for _, path, fields, _ in made["calls"] if path.endswith("sketches") for one in fields}
    assert steered == {"strokes", "sketch", "keyframes", "hold", "cap"}
    types = (Path(hybridmpm_service.__file__).parent / "page" / "client.d.ts").read_text(encoding="utf-8")
    common = {"constructor", "at", "call", "json", "socket", "stream", "events"}
    for kind, names, named in zip(("Client", "Session", "Job"), made["names"], made["named"], strict=True):
        declared = re.search(rf"export class {kind} {{\n(.*?)\n}}", types, re.DOTALL)[1]
        assert set(re.findall(r"^  (\w+)\(", declared, re.MULTILINE)) | common == {*names, *common}
        assert set(names) <= {*named, *common}


def test_the_page_takes_free_strokes_for_what_the_library_takes_them_for(page: Page) -> None:
    strokes = [drawn.stroke.points for drawn in SKETCHES]
    rng = np.random.default_rng(0)
    strokes += [np.cumsum(rng.normal(0, 0.02, (40, 2)), axis=0).clip(-0.5, 0.5) + 0.5 for _ in range(60)]
    script = """async (strokes) => {
      const { classify } = await import("/sketch/sketch.js");
      return strokes.map(classify);
    }"""
    kinds = [classify_stroke(points) for points in strokes]
    assert page.evaluate(script, [np.asarray(points).tolist() for points in strokes]) == kinds
    assert set(kinds) == {"arrow", "ellipse"}


@pytest.mark.parametrize("sweep", [5.6, 2 * math.pi, 7.5])
def test_an_oval_tool_takes_a_traced_oval_and_else_the_one_in_its_box(page: Page, sweep: float) -> None:
    """A traced oval ends where it began, so the box between both was empty: "That stroke was very short"."""
    traced = [[0.5 + 0.1 * math.cos(a), 0.4 + 0.06 * math.sin(a)] for a in np.linspace(1.0, 1.0 + sweep, 60)]
    assert _call(page, "sketch/sketch.js", "ovalFrom", traced) == traced
    shape = _call(page, "sketch/sketch.js", "ellipseOf", traced)
    assert shape["center"] == pytest.approx([0.5, 0.4], abs=0.01)
    assert shape["axes"] == pytest.approx([0.1, 0.06], rel=0.05)
    boxed = np.array(_call(page, "sketch/sketch.js", "ovalFrom", [[0.2, 0.3], [0.3, 0.33], [0.6, 0.5]]))
    assert boxed.min(axis=0) == pytest.approx([0.2, 0.3], abs=1e-3)
    assert boxed.max(axis=0) == pytest.approx([0.6, 0.5], abs=1e-3)


def test_resampling_keeps_ends_and_length(page: Page) -> None:
    points = [[0.1, 0.1], [0.1, 0.1], [0.4, 0.1], [0.4, 0.5]]
    resampled = np.array(_call(page, "sketch/sketch.js", "resample", points, 15))
    assert resampled.shape == (15, 2)
    assert resampled[0] == pytest.approx(points[0])
    assert resampled[-1] == pytest.approx(points[-1])
    steps = np.linalg.norm(np.diff(resampled, axis=0), axis=1)
    assert steps == pytest.approx(np.full(14, 0.05))


@pytest.mark.parametrize("angle", [0.0, 0.5, -1.2])
def test_ellipse_is_found_from_its_outline(page: Page, angle: float) -> None:
    t = np.linspace(0, 2 * math.pi, 120, endpoint=False)
    x, y = 0.2 * np.cos(t), 0.08 * np.sin(t)
    c, s = math.cos(angle), math.sin(angle)
    outline = np.stack([0.6 + x * c - y * s, 0.4 + x * s + y * c], 1)
    shape = _call(page, "sketch/sketch.js", "ellipseOf", outline.tolist())
    assert shape["center"] == pytest.approx([0.6, 0.4], abs=1e-3)
    assert shape["axes"] == pytest.approx([0.2, 0.08], rel=0.01)
    assert shape["angle"] == pytest.approx(angle, abs=0.01)


def test_arrow_head_is_symmetric_about_the_shaft(page: Page) -> None:
    left, tip, right = np.array(_call(page, "sketch/sketch.js", "arrowHead", [[0.0, 0.0], [0.3, 0.4]], 0.1))
    assert tip == pytest.approx([0.3, 0.4])
    shaft = np.array([0.6, 0.8])
    assert (left - tip) @ shaft == pytest.approx((right - tip) @ shaft)
    assert (left + right - 2 * tip) @ [0.8, -0.6] == pytest.approx(0, abs=1e-12)


def test_a_prediction_carries_the_centre_along_an_arrow_and_into_an_oval(page: Page) -> None:
    walls = {"lower": [0.1, 0.1], "upper": [0.9, 0.9]}
    arrow = {"kind": "arrow", "points": [[0.2, 0.2], [0.3, 0.25], [0.4, 0.4]], "widths": [2, 20]}
    goal = _call(page, "sketch/prediction.js", "predicted", arrow, [0.5, 0.3], walls)
    assert goal["region"] is None
    assert np.array(goal["path"]) == pytest.approx(np.array([[0.5, 0.3], [0.6, 0.35], [0.7, 0.5]]))
    outline = _call(page, "sketch/sketch.js", "ovalBetween", [0.4, 0.5], [0.6, 0.7])
    oval = {"kind": "ellipse", "points": outline, "widths": [2, 20]}
    goal = _call(page, "sketch/prediction.js", "predicted", oval, [0.5, 0.3], walls)
    assert np.array(goal["path"]) == pytest.approx(np.array([[0.5, 0.3], [0.5, 0.6]]), abs=1e-3)
    assert goal["region"] == outline
    # In 3D the width of the stroke says how deep.
    room = {"lower": [0.1] * 3, "upper": [0.9] * 3}
    goal = _call(page, "sketch/prediction.js", "predicted", arrow, [0.5, 0.3, 0.2], room)
    assert goal["path"][-1] == pytest.approx([0.7, 0.5, 1.0])
    assert _call(page, "sketch/prediction.js", "predicted", arrow, None, walls) is None


def test_a_hand_is_as_fast_as_its_latest_samples_in_simulated_time(page: Page) -> None:
    samples = [{"point": [0.1 * i, 0.5], "time": 1 + 0.02 * i} for i in range(6)]
    # Over the last 80 ms: three steps of 0.1 m in 60 ms.
    assert _call(page, "sketch/hand.js", "velocityOf", samples, 1.1) == pytest.approx([5, 0])
    assert _call(page, "sketch/hand.js", "velocityOf", samples, 1.3) == [0, 0]
    assert _call(page, "sketch/hand.js", "velocityOf", samples[:1], 1.0) == [0, 0]
    assert _call(page, "sketch/hand.js", "simulated", [0.3, 0.4], 0.25) == pytest.approx([1.2, 1.6])
    assert _call(page, "sketch/hand.js", "simulated", [3, 4], 0.25) == pytest.approx([3, 4])


@pytest.mark.parametrize(
    ("upper", "aspect"), [([0.9, 0.9], 1), ([1.0, 0.4], 0.97 / 0.37), ([0.2, 1.0], 0.5), ([1.0, 0.14], 3)]
)
def test_the_flat_view_is_as_wide_as_its_walls_and_projects_as_its_matrix_says(
    page: Page, upper: list[float], aspect: float
) -> None:
    script = """async ([upper, point]) => {
      const { FlatView } = await import("/stage/camera.js");
      const view = new FlatView({ lower: [0.1, 0.1], upper });
      view.width = 600;
      const m = view.matrix();
      const [x, y] = [0, 1].map((row) => m[row] * point[0] + m[4 + row] * point[1] + m[12 + row]);
      const projected = view.project(point);
      const screen = [300 * (1 + x), 0.5 * view.height * (1 - y)];
      return { screen, projected, back: view.unproject(projected[0], projected[1]), height: view.height };
    }"""
    for point in ([0.1, 0.1], upper):
        seen = page.evaluate(script, [upper, point])
        assert seen["height"] == pytest.approx(600 / aspect)
        assert seen["projected"][:2] == pytest.approx(seen["screen"], abs=0.01)
        assert seen["back"] == pytest.approx(point)
        assert 0 < seen["projected"][0] < 600
        assert 0 < seen["projected"][1] < seen["height"]


def test_orbit_view_projects_as_its_matrix_says(page: Page) -> None:
    script = """async (point) => {
      const { OrbitView } = await import("/stage/camera.js");
      const view = new OrbitView({ lower: [0.1, 0.1, 0.1], upper: [0.9, 0.9, 0.9] });
      view.width = 500;
      view.orbit(40, -25);
      const m = view.matrix();
      const clip = [0, 1, 2, 3].map(
        (row) => m[row] * point[0] + m[4 + row] * point[1] + m[8 + row] * point[2] + m[12 + row],
      );
      const [x, y, z] = [clip[0] / clip[3], clip[1] / clip[3], clip[2] / clip[3]];
      return { screen: [250 + 250 * x, 250 - 250 * y], depth: z, projected: view.project(point) };
    }"""
    for point in ([0.1, 0.1, 0.9], [0.9, 0.9, 0.1], [0.5, 0.3, 0.7], [0.0, 1.0, 1.0]):
        seen = page.evaluate(script, point)
        assert seen["projected"][:2] == pytest.approx(seen["screen"], abs=0.01)
        assert -1 < seen["depth"] < 1


def test_speeds_follow_particles_that_come_and_go(page: Page) -> None:
    script = """async () => {
      const { SpeedEstimate } = await import("/stage/particles.js");
      const speeds = new SpeedEstimate();
      const frames = [
        { time: 0, ids: [2, 5, 9], positions: [0, 0, 1000, 0, 2000, 0] },
        { time: 0.01, ids: [2, 5, 9], positions: [0, 0, 1000, 0, 2000, 1311] },
        { time: 0.02, ids: [5, 9, 11], positions: [1000, 0, 2000, 2622, 0, 0] },
        { time: 0.01, ids: [2, 9], positions: [0, 0, 0, 0] },
      ];
      return frames.map(({ time, ids, positions }) => {
        speeds.update({ time, dim: 2, count: ids.length, ids, positions });
        return [...speeds.bytes];
      });
    }"""
    start, moving, changed, reset = page.evaluate(script)
    assert start == [0, 0, 0]
    assert moving[:2] == [0, 0]
    assert changed[0] == changed[2] == 0
    # 2 m/s are 127.5 of 255, of which 0.4 and then 0.64 have been taken over.
    assert moving[2] == pytest.approx(0.4 * 127.5, abs=1)
    assert changed[1] == pytest.approx(0.64 * 127.5, abs=1.6)
    assert reset == [0, 0]


FLAT = Motion(velocity=(0.2, -0.1), angular_velocity=-3.0, center=(0.4, 0.6), period=0.7, phase=0.3)
STEADY = Motion(velocity=(0.2, -0.1))
SOLID = Motion(velocity=(0.2, -0.1, 0.3), angular_velocity=(1.0, -2.0, 0.5), center=(0.4, 0.6, 0.2))


@pytest.mark.parametrize("motion", [FLAT, STEADY, SOLID])
def test_moving_obstacles_are_where_the_solver_has_them(page: Page, motion: Motion) -> None:
    dim, time = len(motion.velocity or ()), 0.85
    low, high = (0.3, 0.2, 0.1)[:dim], (0.5, 0.7, 0.6)[:dim]
    box = BoxObstacle(lower=low, upper=high, motion=motion)
    moved = box.to_native().moved

    def placed(obstacle: Any) -> Any:
        return _call(
            page, "stage/motion.js", "placed", obstacle.model_dump(mode="json", exclude_none=True), time
        )

    corners = [[(low, high)[(bits >> axis) & 1][axis] for axis in range(dim)] for bits in range(2**dim)]
    assert placed(box)["corners"] == pytest.approx(moved(np.float32(corners), time), abs=1e-6)
    start, end = moved(np.float32([low, high]), time)
    ramp = placed(SegmentObstacle(start=low, end=high, thickness=0.02, motion=motion))
    assert ramp["start"] == pytest.approx(start, abs=1e-6)
    assert ramp["end"] == pytest.approx(end, abs=1e-6)
    ball = placed(BallObstacle(center=low, radius=0.1, motion=motion))
    assert ball["center"] == pytest.approx(start, abs=1e-6)
    normal = np.subtract(high, low)
    plane = placed(HalfSpaceObstacle(point=low, normal=tuple(normal), motion=motion))
    assert plane["point"] == pytest.approx(start, abs=1e-6)
    assert plane["normal"] == pytest.approx(end - start, abs=1e-6)

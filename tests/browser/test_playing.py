"""Pages that play by themselves: the bits of the native solver, and the controls."""

import contextlib
import dataclasses
import itertools
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page
from tests.browser.conftest import PATIENCE_MS
from tests.golden.digests import FRAMES, scenes

import hybridmpm_service
from hybridmpm import (
    Box,
    BoxObstacle,
    CoarseWarning,
    ConfigError,
    Liquid,
    MeshObstacle,
    Motion,
    MpmSolver,
    RigidBall,
    RigidBox,
    RigidCylinder,
    RigidHull,
    Scene,
    SimulationError,
    play,
    probes,
    scenarios,
)
from hybridmpm.coarse import coarse_level
from hybridmpm.control import Arrow, Ellipse, Keyframe, Shape, prepare, prepare_keyframes, pull, push

MODULE = re.compile(r'(?<=id="module">)[^<]*')
"""The module that a page tries first, with instructions that not all browsers have."""
EXACT = re.compile(r'(?<=id="module-exact">)[^<]*')

Show = Callable[..., Page]


@pytest.fixture
def show(browser: Browser, tmp_path: Path) -> Iterator[Show]:
    """Open a page from the disk, where nothing plays by itself; it must not complain."""
    context = browser.new_context(reduced_motion="reduce", viewport={"width": 900, "height": 700})
    errors: list[str] = []

    def note(line: ConsoleMessage) -> None:
        if line.type == "error":
            errors.append(line.text)

    def show_one(text: str, *, ready: bool = True) -> Page:
        file = tmp_path / "page.html"
        file.write_text(text, encoding="utf-8")
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", note)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(file.as_uri())
        if ready:
            page.wait_for_function("() => document.body.dataset.ready !== undefined")
        return page

    yield show_one
    context.close()
    assert errors == []


def advanced(page: Page, frames: int) -> str:
    """Return the digest after some more frames."""
    page.evaluate(f"async () => await ask('advance', {{ frames: {frames}, hand: null, wanted: 'speed' }})")
    digest: str = page.evaluate("async () => (await ask('digest')).digest")
    return digest


@pytest.mark.parametrize("kind", ["relaxed", "exact"])
@pytest.mark.parametrize("name", [*scenes()])
def test_a_page_computes_the_bits_of_the_native_solver(show: Show, name: str, kind: str) -> None:
    frames = FRAMES if kind == "relaxed" else 10
    solver = MpmSolver(scenes()[name], substeps="reference")
    text = play(solver).html
    page = show(text if kind == "relaxed" else MODULE.sub(EXACT.findall(text)[0], text))
    solver.advance(frames)
    assert advanced(page, frames) == solver.digest()


def test_a_page_goes_on_in_mid_splash_among_moving_obstacles_and_rigid_bodies(show: Show) -> None:
    paddle = BoxObstacle(
        lower=(0.45, 0.1),
        upper=(0.5, 0.4),
        motion=Motion(velocity=(0.4, 0.0), angular_velocity=2.0, center=(0.475, 0.25), period=1.3, phase=0.2),
    )
    paste = Liquid(viscosity=4.0, yield_stress=20.0, flow_index=0.6)
    bodies = (
        Box(material="water", lower=(0.3, 0.1), upper=(0.43, 0.25)),
        Box(material="elastic", lower=(0.55, 0.3), upper=(0.65, 0.4), velocity=(0.0, -2.0)),
        Box(material="sand", lower=(0.58, 0.1), upper=(0.7, 0.2)),
        Box(material=paste, lower=(0.74, 0.1), upper=(0.85, 0.35)),
    )
    rigid = (
        RigidBox(lower=(0.3, 0.27), upper=(0.42, 0.33), density=400.0, rotation=0.2),
        RigidBall(center=(0.8, 0.42), radius=0.05, density=2000.0, angular_velocity=20.0),
        RigidHull(points=((0.12, 0.1), (0.22, 0.1), (0.17, 0.2)), velocity=(1.0, 0.0)),
    )
    solver = MpmSolver(Scene(dim=2, bodies=bodies, obstacles=(paddle,), rigid=rigid))
    solver.advance(50)
    page = show(play(solver).html)
    solver.advance(40)
    assert advanced(page, 40) == solver.digest()
    assert numbers_of_bodies(page) == solver.rigid_numbers().ravel().tolist()


def numbers_of_bodies(page: Page) -> list[float]:
    found: list[float] = page.evaluate("async () => { await advance(0); return [...state.rigid]; }")
    return found


def test_a_page_has_the_bits_of_meshes_and_of_bodies_of_all_shapes_in_space(show: Show) -> None:
    outline = [(0.1, 0.1), (0.5, 0.1), (0.1, 0.3)]
    vertices = [(*corner, z) for z in (0.3, 0.7) for corner in outline]
    triangles = [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)]
    rigid = (
        RigidBox(
            lower=(0.3, 0.35, 0.4), upper=(0.45, 0.45, 0.5), rotation=(0.1, 0.2, 0.3), velocity=(0, -2, 0)
        ),
        RigidBall(center=(0.7, 0.35, 0.5), radius=0.06, density=2000.0, velocity=(0, -1, 0)),
        RigidCylinder(start=(0.6, 0.35, 0.7), end=(0.75, 0.4, 0.7), radius=0.05, velocity=(0, -1, 0)),
        RigidHull(points=((0.7, 0.3, 0.2), (0.8, 0.3, 0.2), (0.75, 0.3, 0.3), (0.75, 0.4, 0.25))),
    )
    water = Box(material="water", lower=(0.5, 0.1, 0.1), upper=(0.9, 0.25, 0.9))
    wedge = MeshObstacle(vertices=vertices, triangles=triangles)
    scene = Scene(dim=3, resolution=20, bodies=[water], obstacles=[wedge], rigid=rigid)
    solver = MpmSolver(scene)
    solver.advance(20)
    page = show(play(solver).html)
    solver.advance(80)
    assert advanced(page, 80) == solver.digest()
    assert numbers_of_bodies(page) == solver.rigid_numbers().ravel().tolist()


WHEEL = Scene.load(Path(hybridmpm_service.__file__).parent / "page" / "gallery" / "water-wheel.json")


@pytest.mark.parametrize("name", ["water_2d", "sand_3d", "wheel"])
def test_a_page_shows_all_particles_in_coarse_mode(show: Show, name: str) -> None:
    scene = WHEEL if name == "wheel" else scenarios.get(name, 3)
    solver = MpmSolver(scene, coarse="1/16")
    solver.advance(30)
    page = show(play(solver).html)
    # The second is between two updates of the particles that are shown.
    for frames in (16, 3):
        solver.advance(frames)
        assert advanced(page, frames) == solver.digest()
    assert page.locator("#colour option:disabled").all_inner_texts() == ["density", "pressure"]


@pytest.mark.parametrize(("name", "coarse"), [("water_2d", None), ("water_2d", "1/16"), ("sand_3d", None)])
def test_a_hand_pushes_with_the_bits_of_the_library(show: Show, name: str, coarse: str | None) -> None:
    solver = MpmSolver(scenarios.get(name, 3), coarse=coarse)
    # Numbers that no shorter format than double precision has.
    middle = (solver.positions.mean(axis=0) + np.pi * 1e-3).astype(np.float64)
    velocity = [2.0, 1.1, -0.7][: solver.dim]
    page = show(play(solver).html)
    still = solver.copy()
    still.advance(20)
    for turn in range(5):
        velocity = velocity[::-1]
        # The cap binds in every other turn.
        made = push(middle, velocity, 0.11, cap=15.0 if turn % 2 else 150.0)
        solver.advance(4, made)
        hand = {"point": middle.tolist(), "velocity": velocity, "radius": made.radius, "cap": made.cap}
        page.evaluate("async (hand) => ask('advance', { frames: 4, hand, wanted: 'speed' })", hand)
    assert advanced(page, 0) == solver.digest() != still.digest()


def reckless() -> MpmSolver:
    """Return a coarse solver of soft bodies that fail in a frame at its long step, not at the safe one."""
    # Which frames fail depends on every bit: about one of sixty of these does, and goes on.
    for speed, factor in itertools.product((15.0, 11.0, 16.0, 14.0, 9.0), np.linspace(0.0015, 0.0054, 27)):
        left = Box(material="elastic", lower=(0.15, 0.15), upper=(0.45, 0.4), velocity=(speed, -speed))
        right = Box(material="elastic", lower=(0.6, 0.15), upper=(0.8, 0.4), velocity=(-speed, -speed))
        scene = Scene(dim=2, resolution=64, bodies=(left, right))
        level = dataclasses.replace(
            coarse_level(scene, "1/4"), cfl=1.0, moduli=(float(factor),), fastest=None
        ).named("reckless")
        solver = MpmSolver(scene, coarse=level)
        with warnings.catch_warnings(), contextlib.suppress(SimulationError):
            warnings.simplefilter("ignore")
            solver.advance(30)
            if solver.redone_frames:
                return MpmSolver(scene, coarse=level)
    raise AssertionError("no frame failed at the long step alone")


def test_a_coarse_frame_that_fails_is_done_again_as_by_the_library(show: Show) -> None:
    solver = reckless()
    page = show(play(solver).html)
    with pytest.warns(CoarseWarning):
        solver.advance(30)
    assert solver.redone_frames
    assert advanced(page, 30) == solver.digest()


TANK = Scene.parse(
    {
        "dim": 2,
        "resolution": 64,
        "world": {"size": [1.5, 1.0]},
        "bodies": [{"shape": "box", "material": "water", "lower": [0.2, 0.0], "upper": [0.6, 0.4]}],
        "obstacles": [{"shape": "box", "lower": [0.75, 0.0], "upper": [0.8, 0.2]}],
    }
)
"""A world that is not of one metre: ways and rooms are in units of it."""


HOOK = Shape([[(0.3, 0.4), (0.7, 0.4), (0.7, 0.75), (0.55, 0.75), (0.55, 0.55), (0.3, 0.55)]], width=11.0)


@pytest.mark.parametrize(
    "case", ["arrow", "oval", "ramps", "body", "coarse", "space", "tank", "shape", "shape in space"]
)
def test_material_follows_a_sketch_with_the_bits_of_the_library(show: Show, case: str) -> None:
    sketch: Arrow | Ellipse | Shape = Arrow(points=np.array([[0.35, 0.35], [0.6, 0.65]]))
    if case == "oval":
        sketch = Ellipse(center=(0.5, 0.6), axes=(0.15, 0.12), angle=0.0)
    elif case.startswith("shape"):
        sketch = HOOK  # Places are matched anew at the frames 30 and 50.
    name = {"ramps": "water_ramps_2d", "space": "water_3d", "shape in space": "water_3d"}.get(
        case, "water_2d"
    )
    scene = TANK if case == "tank" else scenarios.get(name, 3)
    solver = MpmSolver(scene, coarse="1/16" if case == "coarse" else None)
    planned = solver.copy()
    planned.advance(10)
    who = 0 if case == "body" else None
    guidance = prepare(planned, sketch, "analytic", frames=30, hold=5, who=who)
    page = show(play(solver, guidance=guidance).html)
    for frames in (20, 40):
        solver.advance(frames, guidance)
        assert advanced(page, frames) == solver.digest()


@pytest.mark.long
def test_a_page_takes_up_a_shape_whose_places_were_matched_anew(show: Show) -> None:
    solver = MpmSolver(scenarios.water_2d(3))
    guidance = prepare(solver, HOOK, "analytic", frames=30, hold=25)
    solver.advance(25, guidance)
    page = show(play(solver, guidance=guidance).html)
    solver.advance(30, guidance)
    assert advanced(page, 30) == solver.digest()


@pytest.mark.parametrize("begun", [0, pytest.param(45, marks=pytest.mark.long)])
def test_several_goals_are_followed_in_turn_with_the_bits_of_the_library(show: Show, begun: int) -> None:
    oval = Ellipse(center=(0.5, 0.6), axes=(0.15, 0.12), angle=0.0)
    arrow = Arrow(points=np.array([[0.5, 0.5], [0.45, 0.6]]))
    solver = MpmSolver(scenarios.water_2d(3))
    sequence = prepare_keyframes(solver, [(HOOK, 40), Keyframe(oval, 30, hold=5), (arrow, 20)])
    solver.advance(begun, sequence)
    page = show(play(solver, guidance=sequence).html)
    solver.advance(100 - begun, sequence)
    assert advanced(page, 100 - begun) == solver.digest()
    shown = page.evaluate("scene.sketches.map(({ first, last, isArrow }) => [first, last, isArrow])")
    legs = [[0, 40, False], [40, 75, False], [75, 95, True]]
    assert shown == (legs if begun == 0 else legs[1:])


def by_hand(page: Page, tool: str, points: list[tuple[float, float]]) -> dict[str, Any]:
    """Draw through points of the world; return what the page took."""
    page.select_option("#drag", tool)
    to_picture = """([x, y]) => {
        const [box, [a, b]] = [picture.getBoundingClientRect(), projection()(x, y)];
        return [box.left + (a * box.width) / picture.width, box.top + (b * box.height) / picture.height];
    }"""
    places = [page.evaluate(to_picture, list(point)) for point in points]
    page.evaluate("drawn = null")
    page.mouse.move(*places[0])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*place, steps=4)
    page.mouse.up()
    page.wait_for_function("() => drawn !== null || part('message').classList.contains('error')")
    page.evaluate("pause()")
    page.wait_for_function("() => !busy")
    taken: dict[str, Any] = page.evaluate("({ ...drawn, at: state.frame })")
    return taken


@pytest.mark.parametrize("tool", ["shape", "arrow"])
@pytest.mark.parametrize("name", ["water_2d", pytest.param("tank", marks=pytest.mark.long)])
def test_a_visitor_draws_and_the_fluid_follows_as_in_the_library(show: Show, name: str, tool: str) -> None:
    solver = MpmSolver(TANK if name == "tank" else scenarios.get(name, 3))
    solver.advance(30)
    page = show(play(solver).html)
    line = [(0.3, 0.6), (0.7, 0.6), (0.7, 0.85), (0.5, 0.75), (0.3, 0.85)]
    taken = by_hand(page, tool, line if tool == "shape" else [(0.4, 0.2), (0.45, 0.4)])
    assert (taken["first"], taken["last"]) == (30, 270)
    (points,) = taken["lines"]
    sketch = Shape((points[:-1],)) if tool == "shape" else Arrow(points)
    guidance = prepare(solver, sketch, "analytic", frames=160, hold=80, gentle=False)
    solver.advance(80, guidance)
    frames = 80 - (taken["at"] - 30)
    if tool == "shape":
        assert advanced(page, frames) == solver.digest()
        return
    # Means over the particles are summed in another order there.
    advanced(page, frames)
    order = "ask('advance', { frames: 0, hand: null, wanted: 'speed' })"
    present = f"async () => Array.from((await {order}).positions)"
    x = np.array(page.evaluate(present))
    np.testing.assert_allclose(x.reshape(-1, 2), solver.positions, atol=2e-3)


def test_drawings_that_cannot_be_followed_are_refused_in_sentences(show: Show) -> None:
    page = show(play(TANK).html)
    by_hand(page, "arrow", [(0.4, 0.2), (1.2, 0.2)])
    said = page.inner_text("#message")
    assert said.startswith("The arrow must be one along which the fluid has room in its shape")


def test_only_ways_are_followed() -> None:
    solver = MpmSolver(scenarios.water_2d(3))
    guidance = prepare(solver, Arrow(points=np.array([[0.35, 0.35], [0.6, 0.65]])), "constant", frames=30)
    with pytest.raises(ConfigError, match="by the method analytic or learned, got 'constant'"):
        play(solver, guidance=guidance)


PADDLE = BoxObstacle(
    lower=(0.45, 0.1), upper=(0.5, 0.3), motion=Motion(angular_velocity=2.0, center=(0.475, 0.2), period=1.3)
)
PLANE = Scene(
    dim=2,
    resolution=64,
    bodies=(Box(material="water", lower=(0.1, 0.1), upper=(0.4, 0.4), velocity=(2.0, 0.0)),),
    obstacles=(PADDLE, BoxObstacle(lower=(0.7, 0.05), upper=(0.75, 0.15))),
    rigid=(RigidBox(lower=(0.62, 0.3), upper=(0.82, 0.5), density=400.0),),
)
SPACE = Scene(
    dim=3,
    resolution=32,
    bodies=(Box(material="water", lower=(0.1, 0.1, 0.1), upper=(0.4, 0.4, 0.9), velocity=(2.0, 0.0, 0.0)),),
    obstacles=(BoxObstacle(lower=(0.6, 0.1, 0.4), upper=(0.7, 0.2, 0.6)),),
    rigid=(RigidBox(lower=(0.45, 0.3, 0.4), upper=(0.6, 0.45, 0.6), density=400.0),),
)
GAUGES = {
    2: {
        "density": probes.Density([[0.3, 0.2], [0.52, 0.12]]),
        "patch": probes.PatchDensity((0.4, 0.1), (0.6, 0.3)),
        "pressure": probes.Pressure([[0.2, 0.1], [0.475, 0.12], [0.7, 0.12], [0.85, 0.8]]),
        "mean pressure": probes.PatchPressure((0.1, 0.1), (0.3, 0.2)),
        "height": probes.HeightGauge(0.42),
        "level": probes.FillLevel((0.4, 0.1), (0.9, 0.2)),
        "flow": probes.Flow((0.43, 0.1), (0.43, 0.4)),
        "force": probes.Force(obstacle=1),
        "floor": probes.Force(wall="y_lower"),
        "torque": probes.Torque(obstacle=0, about=(0.475, 0.2)),
        "submerged": probes.Submerged(0),
    },
    3: {
        "density": probes.Density((0.5, 0.12, 0.5)),
        "pressure": probes.Pressure([[0.2, 0.1, 0.5], [0.6, 0.15, 0.5]]),
        "height": probes.HeightGauge((0.42, 0.5)),
        "level": probes.FillLevel((0.5, 0.1, 0.3), (0.8, 0.2, 0.7)),
        "flow": probes.Flow((0.43, 0.1, 0.1), (0.43, 0.4, 0.9)),
        "force": probes.Force(obstacle=0),
        "torque": probes.Torque(obstacle=0, about=(0.6, 0.1, 0.4)),
        "submerged": probes.Submerged(0),
    },
}


@pytest.mark.parametrize(("dim", "coarse"), [(2, None), (3, None), (2, "1/8")])
def test_charts_have_the_readings_of_the_library(show: Show, dim: int, coarse: str | None) -> None:
    solver = MpmSolver(PLANE if dim == 2 else SPACE, coarse=coarse)
    page = show(play(solver, probes=GAUGES[dim]).html)
    page.evaluate("async () => await advance(160)")
    series = probes.record(solver, 160, GAUGES[dim], every=4)
    read = page.evaluate("() => charts.map((chart) => chart.readings.map(([t, v]) => [t, ...v.map(String)]))")
    for (name, values), rows in zip(series.values.items(), read, strict=True):
        times, numbers = np.split(np.array(rows, dtype=float), [1], axis=1)
        np.testing.assert_allclose(times[:, 0], series.time, rtol=1e-6, err_msg=name)
        wanted = values.reshape(len(times), -1)
        size = np.nanmax(np.abs(wanted))
        np.testing.assert_allclose(numbers, wanted, rtol=1e-6, atol=1e-6 * size, err_msg=name)
        assert size > 0
    assert page.locator("figure b").all_inner_texts() == list(GAUGES[dim])
    page.click("#reset")
    page.wait_for_function("() => document.body.dataset.frame === '0'")
    assert page.evaluate("() => charts.map((chart) => chart.readings.length)") == [1] * len(read)


@pytest.mark.parametrize(("dim", "hand"), [(2, "finger"), (3, "mouse")])
def test_a_visitor_pulls_a_body_as_the_library_does(show: Show, dim: int, hand: str) -> None:
    solver = MpmSolver(PLANE if dim == 2 else SPACE)
    page = show(play(solver).html)
    if dim == 3:
        # Of three sides that are seen, each is as bright as it faces the light; the edges are lighter.
        shades = page.evaluate(
            """() => {
              const seen = [];
              addBodies((place, i, radius, tint, light) => seen.push(`${tint[0]} ${light.toFixed(3)}`));
              return [...new Set(seen)];
            }"""
        )
        assert len({one.split()[1] for one in shades}) == 3
        assert len({one.split()[0] for one in shades}) == 3
    (x, y), (to_x, to_y) = page.evaluate(
        """() => [[0, 0, 0], [0.1, 0.15, 0]].map((by) => {
          const box = picture.getBoundingClientRect();
          const [x, y] = projection()(...poseOf(0).center.map((value, axis) => value + by[axis]));
          return [box.left + (x * box.width) / picture.width, box.top + (y * box.height) / picture.height];
        })"""
    )
    if hand == "mouse":
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(to_x, to_y, steps=3)
    else:
        finger = page.context.new_cdp_session(page)
        finger.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
        for kind, place in (("Start", (x, y)), ("Move", (to_x, to_y))):
            point = {"x": place[0], "y": place[1]}
            finger.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": [point]})
    order = page.evaluate("() => push()")
    # The force lifts at most a square or cube of water with three tenths of the side between the walls.
    assert order["strength"] == pytest.approx(1000 * 0.24**dim * 9.81)
    page.evaluate("async () => await advance(60)")
    solver.advance(60, pull(**order))
    assert page.evaluate("async () => (await ask('digest')).digest") == solver.digest()
    assert np.linalg.norm(solver.rigid_bodies.center[0] - solver.scene.rigid[0].mass_center) > 0.1
    if hand == "mouse":
        page.mouse.up()
    else:
        finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert page.evaluate("() => push()") is None


def test_a_probe_that_does_not_fit_is_refused() -> None:
    class Mine(probes.Flow):
        plain = probes.Probe.plain

    with pytest.raises(ConfigError, match=r"a page reads probes of hybridmpm\.probes, got Mine"):
        play(PLANE, probes={"mine": Mine((0.4, 0.1), (0.4, 0.2))})
    with pytest.raises(ConfigError, match="must lie inside the walls"):
        play(PLANE, probes={"far": probes.Density((0.0, 0.0))})
    with pytest.raises(ConfigError, match="this takes a probe"):
        play(PLANE, probes={"none": 0.5})  # type: ignore[dict-item]


def test_a_page_plays_steps_pushes_and_begins_again(show: Show) -> None:
    solver = MpmSolver(scenarios.water_2d(3))
    page = show(play(solver, name="Two <blocks>", text="# A title\n\nSome *words*.").html)
    assert page.title() == "Two <blocks>"
    assert page.locator("#lesson h2").inner_text() == "A title"
    assert page.locator("#lesson em").inner_text() == "words"
    page.click("#step")
    page.wait_for_function("() => document.body.dataset.frame === '1'")
    page.click("#show-digest")
    page.wait_for_function("() => document.getElementById('digest').value !== ''")
    solver.advance()
    assert page.locator("#digest").evaluate("output => output.value") == solver.digest()
    box = page.locator("#picture").bounding_box()
    assert box is not None
    page.click("#play")
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.8 * box["height"])
    page.mouse.down()
    for i in range(20):
        page.mouse.move(box["x"] + (0.3 + 0.02 * i) * box["width"], box["y"] + 0.8 * box["height"])
        page.wait_for_timeout(20)
    page.mouse.up()
    page.wait_for_function("() => Number(document.body.dataset.frame) > 20")
    page.click("#play")
    page.select_option("#colour", "pressure")
    page.click("#reset")
    page.wait_for_function("() => document.body.dataset.frame === '0'")
    page.click("#show-digest")
    page.wait_for_function("() => document.getElementById('digest').dataset.frame === '0'")
    solver.reset()
    assert page.locator("#digest").evaluate("output => output.value") == solver.digest()


def test_a_damaged_page_says_so(show: Show) -> None:
    text = play(scenarios.water_2d(3)).html
    other = play(scenarios.water_3d(3)).html
    page = show(MODULE.sub(MODULE.findall(other)[0], text))
    assert "it is of a scene in 2D, and this build plays those in 3D" in page.locator("#message").inner_text()
    start = re.search(r'id="start">[^<]{100}', text)
    assert start is not None
    for damaged in (
        text.replace('id="scene">{', 'id="scene">'),
        text.replace(start[0], 'id="start">!' + start[0][-99:]),
        text.replace(start[0], 'id="start">' + start[0][-100:][::-1]),
    ):
        assert show(damaged).locator("#message").inner_text() == "This file is damaged: get it once more."
    cut = show(text[: text.index('id="module"')], ready=False)
    assert "If this line stays, the file is cut off" in cut.locator("#message").inner_text()


def test_a_browser_that_cannot_play_says_which_can(show: Show) -> None:
    text = play(scenarios.water_2d(3)).html
    old = text.replace("WebAssembly.validate(bytes)", "false")
    assert "no vector instructions for WebAssembly (simd128)" in show(old).locator("#message").inner_text()
    older = text.replace("typeof DecompressionStream", "typeof Missing")
    assert "This browser is too old to play" in show(older).locator("#message").inner_text()


def test_a_picture_that_is_lost_is_drawn_again(show: Show) -> None:
    page = show(play(scenarios.water_2d(3)).html)
    page.evaluate("picture.dispatchEvent(new Event('contextlost'))")
    assert "has taken the picture's memory away" in page.locator("#message").inner_text()
    page.evaluate("picture.dispatchEvent(new Event('contextrestored'))")
    assert page.locator("#message").is_hidden()
    told = page.evaluate("[new RangeError('x'), new Error('a sentence')].map(reason)")
    assert told == [
        "This device has no memory left for the picture: close other pages, and reload this one.",
        "a sentence",
    ]


def test_a_text_is_markdown_that_cannot_run_or_load() -> None:
    text = (
        "A [link](index.html), `a < b`, {{module}}.\n\n- one\n- two\n\n<script>run()</script>\n\n"
        "[bad](javascript:run()) [worse](data:text/html,run) ![picture](http://example.com/a.png)"
    )
    page = play(scenarios.water_2d(3), text=text).html
    lesson = page[page.index("<article") : page.index("</article>")]
    assert '<a href="index.html">link</a>, <code>a &lt; b</code>, {{module}}.' in lesson
    assert "<li>one</li>" in lesson
    assert "&lt;script&gt;run()&lt;/script&gt;" in lesson
    assert re.findall("<(?:script|img|iframe)|href=.(?:javascript|data)", lesson) == []


@pytest.mark.parametrize("wrong", [scenarios.NAMES, None, "waves.yaml"])
def test_only_scenes_and_solvers_play(wrong: object) -> None:
    with pytest.raises(ConfigError, match="a page plays a Scene or an MpmSolver"):
        play(wrong)  # type: ignore[arg-type]


def test_files_have_a_suffix_and_a_size(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"must be an \.html file"):
        play(scenarios.water_2d(3), tmp_path / "waves.gif")
    file = tmp_path / "waves.html"
    page = play(scenarios.water_2d(3), file)
    assert file.read_text(encoding="utf-8") == page.html
    assert file.stat().st_size < 1_200_000
    assert "http" not in re.sub(r"<script type=\"text/plain\".*?</script>", "", page.html, flags=re.DOTALL)

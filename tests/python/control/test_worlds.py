"""Sketches in worlds of any size: in metres, and the same as in a world of one metre but for the unit."""

import numpy as np
import pytest

from hybridmpm import MpmSolver, Scene, SketchError
from hybridmpm.control import (
    Arrow,
    Ellipse,
    Guidance,
    Sketch,
    follow,
    parse_png,
    parse_strokes,
    prepare,
    render_png,
)

TANK = (1.6, 0.6)
ARROW = Arrow([(0.3, 0.2), (0.9, 0.35), (1.3, 0.25)])
OVAL = Ellipse([1.2, 0.3], [0.2, 0.12], 0.3)


def tank(**changes: object) -> Scene:
    block = {"shape": "box", "material": "water", "lower": [0.2, 0.0], "upper": [0.5, 0.25]}
    given = {"dim": 2, "resolution": 60, "world": {"size": TANK}, "bodies": [block]}
    return Scene.parse(given | changes)


def room(unit: float) -> Scene:
    """Return a scene with all lengths in multiples of a unit: its motion is the same in units."""

    def place(*x: float) -> list[float]:
        return [unit * one for one in x]

    return Scene.parse(
        {
            "dim": 2,
            "world": {"size": place(1, 1)},
            "resolution": round(64 / unit),
            "gravity": place(0, -9.81),
            "walls": {"lower": place(0.1, 0.1), "upper": place(0.9, 0.9)},
            "bodies": [
                {
                    "shape": "box",
                    "material": {"kind": "water", "max_compression": 0.05},
                    "lower": place(0.15, 0.1),
                    "upper": place(0.4, 0.3),
                }
            ],
            "obstacles": [{"shape": "ball", "center": place(0.55, 0.3), "radius": 0.08 * unit}],
        }
    )


def sketches(unit: float) -> dict[str, Sketch]:
    return {
        "arrow": Arrow(unit * np.array([(0.27, 0.2), (0.4, 0.6), (0.75, 0.5)])),
        "behind the ball": Arrow(unit * np.array([(0.27, 0.2), (0.8, 0.25)])),
        "oval": Ellipse(unit * np.array([0.6, 0.6]), unit * np.array([0.2, 0.1]), 0.5),
    }


def planned(unit: float, name: str, method: str) -> tuple[Guidance, MpmSolver]:
    solver = MpmSolver(room(unit))
    return prepare(solver, sketches(unit)[name], method, cap=20 * unit, frames=120, gentle=False), solver


@pytest.mark.parametrize("unit", [0.5, 4.0])
@pytest.mark.parametrize("name", sketches(1.0))
def test_plans_are_the_same_in_units_of_the_world(name: str, unit: float) -> None:
    expected, of_a_metre = planned(1.0, name, "analytic")
    found, solver = planned(unit, name, "analytic")
    np.testing.assert_allclose(found.goal.path, unit * expected.goal.path, rtol=1e-6)
    assert found.needs().acceleration == pytest.approx(unit * expected.needs().acceleration, rel=1e-6)
    assert found.needs().reachable == expected.needs().reachable
    for _ in range(3):
        wanted, force = expected(of_a_metre), found(solver)
        assert np.abs(force / unit - wanted).max() < 1e-3 * np.abs(wanted).max()
        of_a_metre.advance(1, wanted)
        solver.advance(1, force)


@pytest.mark.parametrize("method", ["analytic", "constant", "auto"])
def test_a_block_follows_an_arrow_through_a_tank(method: str) -> None:
    solver = MpmSolver(tank())
    following = follow(solver, ARROW, method, cap=40)
    result = following.run()
    tip = solver.positions.astype(np.float64).mean(axis=0)
    start = following.guidance.goal.path[0]
    if method == "constant":
        assert result.reached.miss < 0.1
    else:
        assert result.reached.goal, str(result.reached)
        np.testing.assert_allclose(tip - start, [1.0, 0.05], atol=0.02)


def test_a_block_fills_an_oval_of_a_tank() -> None:
    following = follow(MpmSolver(tank()), OVAL, cap=40)
    result = following.run()
    assert result.reached.inside is not None
    assert result.reached.inside > 0.9
    assert result.reached.miss < 0.03
    restored = Guidance.restored(following.guidance.snapshot(), tank())
    solver = MpmSolver(tank())
    assert np.array_equal(restored(solver), following.guidance(solver))


@pytest.mark.parametrize("size", [TANK, (0.15, 0.4), (3.2, 3.2), (0.5, 2.0, 1.0)])
def test_a_picture_of_a_sketch_in_a_world_is_read_as_it_was_drawn(size: tuple[float, ...]) -> None:
    width, height = size[:2]
    longest = max(size)
    arrow = Arrow([(0.2 * width, 0.3 * height), (0.8 * width, 0.7 * height)])
    read = parse_png(render_png(arrow, size), size)
    assert isinstance(read, Arrow)
    np.testing.assert_allclose(read.points[[0, -1]], arrow.points, atol=0.01 * longest)
    oval = Ellipse([0.5 * width, 0.4 * height], [0.2 * min(width, height), 0.15 * min(width, height)], 0.4)
    again = parse_png(render_png(oval, size), size)
    assert isinstance(again, Ellipse)
    np.testing.assert_allclose(again.center, oval.center, atol=0.01 * longest)
    np.testing.assert_allclose(again.axes, oval.axes, atol=0.01 * longest)


def test_strokes_are_in_metres_of_their_world() -> None:
    arrow = parse_strokes([{"points": [[0.2, 0.1], [1.5, 0.5]]}], TANK)
    assert isinstance(arrow, Arrow)
    turn = np.linspace(0, 2 * np.pi, 60)
    round_ = np.column_stack([1.2 + 0.3 * np.cos(turn), 0.3 + 0.2 * np.sin(turn)])
    oval = parse_strokes([{"points": round_.tolist()}], TANK)
    assert isinstance(oval, Ellipse)
    np.testing.assert_allclose(oval.axes, [0.3, 0.2], rtol=0.02)


@pytest.mark.parametrize(
    ("sketch", "message"),
    [
        (
            Arrow([(0.3, 0.2), (0.9, 0.7)]),
            r"points\[1\]: must be in \[0, 1.6\] x \[0, 0.6\] m, got \[0.9, 0.7\]",
        ),
        (Arrow([(0.3, 0.2), (0.301, 0.2)]), r"the stroke is 0.001 long, must be at least 0.00625"),
        (Ellipse([1.2, 0.7], [0.2, 0.1], 0.0), r"center must be in \[0, 1.6\] x \[0, 0.6\] m"),
        (Ellipse([1.2, 0.3], [1.7, 0.1], 0.0), r"axes must be two lengths in \[0.00625, 1.6\]"),
    ],
)
def test_a_sketch_outside_of_its_world_is_refused(sketch: Sketch, message: str) -> None:
    with pytest.raises(SketchError, match=message):
        prepare(MpmSolver(tank()), sketch)


@pytest.mark.parametrize("method", ["learned", "controlnet"])
def test_networks_leave_worlds_that_they_were_not_trained_for(method: str) -> None:
    guidance = prepare(MpmSolver(tank()), OVAL, method, cap=40)
    assert guidance.method == "analytic"
    assert "it is trained in worlds of one metre along each axis" in guidance.reason


def test_who_is_led_is_chosen_by_a_stroke_in_metres() -> None:
    two = [
        {"shape": "box", "material": "water", "lower": [x, 0.0], "upper": [x + 0.2, 0.2]} for x in (0.1, 1.2)
    ]
    solver = MpmSolver(tank(bodies=two))
    stroke = {"points": [[1.22, 0.1], [1.38, 0.1]], "kind": "arrow"}
    guidance = prepare(solver, Arrow([(1.3, 0.1), (1.0, 0.4)]), who=stroke, cap=40)
    assert guidance.goal.cloud.x[:, 0].min() > 1.1

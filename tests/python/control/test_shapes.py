"""Closed outlines as goals: their geometry, holes, growth, texts and pictures, and fluids that fill them."""

import re
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from hybridmpm import Box, BoxObstacle, MpmSolver, Scene, SketchError
from hybridmpm.control import (
    Arrow,
    Guidance,
    Shape,
    follow,
    prepare,
    render_png,
    shape_of_path,
    shape_of_picture,
    shape_of_text,
)

TURN = np.linspace(0, 2 * np.pi, 90, endpoint=False)
CIRCLE = np.column_stack([np.cos(TURN), np.sin(TURN)])
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def solver_of(dim: int = 2, **more: Any) -> MpmSolver:
    """Return a block of water at rest."""
    lower, upper = (0.2, 0.2, 0.4)[:dim], (0.35, 0.35, 0.55)[:dim]
    body = Box(lower=lower, upper=upper, material="water")
    return MpmSolver(Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=[body], **more))


def ring(outer: float, inner: float, center: tuple[float, float] = (0.6, 0.55)) -> Shape:
    return Shape((center + outer * CIRCLE, center + inner * CIRCLE))


def test_area_and_inside_follow_the_even_odd_rule() -> None:
    shape = ring(0.2, 0.1)
    exact = 90 / 2 * np.sin(2 * np.pi / 90)
    assert shape.area == pytest.approx(exact * (0.2**2 - 0.1**2), rel=2e-3)
    np.testing.assert_allclose(shape.center, [0.6, 0.55], atol=1e-6)
    points = np.random.default_rng(5).uniform(0.3, 0.9, (4000, 2))
    away = np.linalg.norm(points - [0.6, 0.55], axis=1)
    clear = (np.abs(away - 0.2) > 5e-4) & (np.abs(away - 0.1) > 5e-4)
    np.testing.assert_array_equal(shape.covers(points)[clear], ((away < 0.2) & (away > 0.1))[clear])
    assert not shape.crosses_itself
    # A line that goes round twice encloses nothing where it lies twice; a pentagram has an empty middle.
    star = Shape((0.5 + 0.3 * CIRCLE[::18][[0, 2, 4, 1, 3]],))
    assert star.crosses_itself
    assert star.covers(np.array([[0.5, 0.5], [0.5 + 0.25, 0.5]])).tolist() == [False, True]


@pytest.mark.parametrize(
    ("outlines", "message"),
    [
        ([], "there must be 1 to 64 lines, got 0"),
        ([[[0.1, 0.1], [0.2, 0.2]]], "outlines[0]: a closed line has at least 3 points, got 2"),
        ([[[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]]], "the lines enclose nothing"),
        ([SQUARE * 0.1 + 0.5, SQUARE * 0.1 + 0.5], "the lines enclose nothing"),
        (
            [[[0.1, 0.1], [0.2, np.nan], [0.3, 0.3]]],
            "outlines[0]: points[1] must be two numbers in [0, 4096]",
        ),
        ("letters", "outlines must be a sequence of lines, got str"),
    ],
)
def test_what_is_no_shape_is_refused(outlines: Any, message: str) -> None:
    with pytest.raises(SketchError, match=re.escape(message)):
        Shape(outlines)


def test_a_shape_has_to_lie_in_the_world_and_to_be_seen_there() -> None:
    solver = solver_of()
    with pytest.raises(SketchError, match=r"outlines\[0\]\.points\[1\]: must be two numbers in \[0, 1\]"):
        prepare(solver, Shape((0.6 * SQUARE + [0.7, 0.7],)))
    with pytest.raises(SketchError, match="they must reach over at least"):
        prepare(solver, Shape((0.001 * SQUARE + 0.5,)))
    filled = solver_of(obstacles=[BoxObstacle(lower=(0.5, 0.5), upper=(0.7, 0.7))])
    with pytest.raises(SketchError, match="no part of the shape is free"):
        prepare(filled, Shape((0.05 * SQUARE + 0.6,)))


def test_a_small_shape_grows_with_its_hole() -> None:
    solver = solver_of()
    room = 1.08 * solver.particle_count * solver.particle_spacing**2
    goal = prepare(solver, ring(0.08, 0.04)).goal
    assert goal.region is not None
    assert goal.region.volume == pytest.approx(room, rel=0.01)
    scale = goal.region.scale
    assert scale == pytest.approx(np.sqrt(room / ring(0.08, 0.04).area), rel=0.01)
    away = np.linalg.norm(goal.region.cells - [0.6, 0.55], axis=1)
    assert away.min() > 0.95 * scale * 0.04
    assert away.max() < 1.02 * scale * 0.08
    assert f"grown to {scale:.2f} times" in str(prepare(solver, ring(0.08, 0.04)).needs())


def test_obstacles_take_their_part_of_a_shape() -> None:
    free = prepare(solver_of(), ring(0.09, 0.03)).goal.region
    obstacle = BoxObstacle(lower=(0.6, 0.4), upper=(0.8, 0.7))
    goal = prepare(solver_of(obstacles=[obstacle]), ring(0.09, 0.03)).goal
    assert free is not None
    assert goal.region is not None
    assert goal.region.volume == pytest.approx(free.volume, rel=0.01)
    assert goal.region.scale == pytest.approx(np.sqrt(2) * free.scale, rel=0.02)
    assert goal.region.cells[:, 0].max() < 0.6
    assert prepare(solver_of(obstacles=[obstacle]), ring(0.09, 0.03)).needs().taken == pytest.approx(
        0.5, abs=0.02
    )


def test_a_fluid_fills_a_letter_and_goes_on_from_a_snapshot() -> None:
    letter = np.array([[0.5, 0.4], [0.7, 0.4], [0.7, 0.49], [0.59, 0.49], [0.59, 0.65], [0.5, 0.65]])
    shape = Shape((letter,))
    solver = solver_of()
    following = follow(solver, shape, hold=10)
    assert following.guidance.method == "analytic"
    frames = following.guidance.frames
    kept, twins = [], []
    # On the way, and between two times at which places are matched anew.
    for stop in (30, frames - 30):
        while following.frames_done < stop:
            next(following)
        kept.append((solver.snapshot(), following.guidance.snapshot()))
        twins.append((solver.copy(), following.guidance.copied()))
    following.run()
    reached = following.result.reached
    assert reached.inside is not None
    assert reached.inside > 0.98
    assert reached.inside_drawn == pytest.approx(reached.inside, abs=0.06)
    assert "in the goal as drawn" in str(reached)
    for state, data in kept:
        other = solver_of()
        other.restore(state)
        restored = Guidance.restored(data, other.scene)
        assert isinstance(restored.sketch, Shape)
        other.advance(following.guidance.total_frames - other.frame, restored)
        assert other.digest() == solver.digest()
    for twin, guidance in twins:
        twin.advance(following.guidance.total_frames - twin.frame, guidance)
        assert twin.digest() == solver.digest()


def test_places_of_a_shape_are_matched_anew_whatever_happened_before() -> None:
    solver = solver_of()
    guidance = prepare(solver, ring(0.1, 0.05), frames=60, hold=20)
    middle = 50
    solver.advance(middle, guidance)
    state, data = solver.snapshot(), guidance.snapshot()
    solver.advance(15, guidance)
    straight = solver.digest()
    solver.restore(state)
    solver.advance(5, np.array([2.0, 9.81]))
    solver.advance(10, guidance)
    assert solver.digest() != straight
    solver.restore(state)
    solver.advance(15, guidance)
    assert solver.digest() == straight
    assert Guidance.restored(data, solver.scene).snapshot() == data


def test_a_shape_in_space_is_as_deep_as_the_fluid_needs() -> None:
    solver = solver_of(3)
    volume = solver.particle_count * solver.particle_spacing**3
    goal = prepare(solver, Shape((0.1 * SQUARE + 0.5,), width=11.0)).goal
    assert goal.region is not None
    cells = goal.region.cells
    assert np.ptp(cells[:, 2]) == pytest.approx(1.15 * volume / 0.04, rel=0.1)
    np.testing.assert_allclose(cells.mean(axis=0), 0.5, atol=0.01)
    thin = prepare(solver, Shape((0.4 * SQUARE + 0.5,))).needs()
    assert [one.reason for one in thin.obstructions] == ["shape"]
    assert "fills the shape 0.7 cm deep, and 4 grid cells are 12.5 cm: draw it smaller" in str(thin)
    assert thin.scale == 1


def test_what_is_too_thin_or_crosses_itself_is_said() -> None:
    solver = solver_of()
    comb = [(0.3 + 0.02 * x, 0.5 + 0.15 * (x % 2)) for x in range(20)]
    thin = prepare(solver, Shape(([*comb, (0.68, 0.45), (0.3, 0.45)],)))
    assert [one.reason for one in thin.needs().obstructions] == ["shape"]
    assert re.search(
        r"\d+ % of the shape is thinner than 4 grid cells, 6.2 cm: draw it wider", str(thin.needs())
    )
    assert "approached with at most" in thin.reason
    fork = [
        (0.3, 0.3),
        (0.6, 0.3),
        (0.6, 0.6),
        (0.48, 0.6),
        (0.48, 0.4),
        (0.45, 0.4),
        (0.45, 0.6),
        (0.3, 0.6),
    ]
    (note,) = prepare(solver, Shape((fork,)), fill="shrink").needs().notes
    assert re.match(r"gaps of \d+ % of the shape's area are narrower than 4 grid cells, 6.2 cm: some", note)
    star = prepare(solver, Shape((0.5 + 0.3 * CIRCLE[::18][[0, 2, 4, 1, 3]],))).needs()
    assert "lines of the shape cross: what they enclose an odd number of times is filled" in star.notes


@pytest.mark.parametrize("method", ["learned", "controlnet"])
def test_networks_that_have_seen_no_shape_leave_it_to_guidance(method: str) -> None:
    guidance = prepare(solver_of(), ring(0.1, 0.04), method)
    assert guidance.method == "analytic"
    assert "the network follows arrows and ovals only" in guidance.reason


def test_letters_are_traced_with_their_holes() -> None:
    shape = shape_of_text("OB", (0.5, 0.4), 0.3)
    assert len(shape.outlines) == 5
    low, high = shape.bounds
    np.testing.assert_allclose((low + high) / 2, [0.5, 0.4], atol=2e-3)
    assert high[1] - low[1] == pytest.approx(0.3, rel=0.02)
    assert sum(map(len, shape.outlines)) <= 512
    with pytest.raises(SketchError, match="text must have letters"):
        shape_of_text(" ", (0.5, 0.5), 0.2)


def test_the_dark_parts_of_a_picture_are_a_shape() -> None:
    picture = Image.new("RGBA", (200, 100), (0, 0, 0, 0))
    ImageDraw.Draw(picture).ellipse((50, 10, 130, 90), fill="black")
    shape = shape_of_picture(picture, (0.5, 0.5), 0.2)
    assert shape.area == pytest.approx(np.pi * 0.1**2, rel=0.02)
    grey = np.asarray(picture.getchannel("A"), dtype=np.float64)
    assert shape_of_picture(255 - grey, (0.5, 0.5), 0.2).area == pytest.approx(shape.area, rel=1e-6)
    with pytest.raises(SketchError, match="equally dark"):
        shape_of_picture(np.zeros((20, 20)), (0.5, 0.5), 0.2)


def test_a_shape_is_drawn_in_pictures_and_chooses_particles() -> None:
    assert render_png(ring(0.2, 0.1)).startswith(b"\x89PNG")
    solver = solver_of()
    arrow = Arrow(np.array([[0.3, 0.3], [0.6, 0.3]]))
    chosen = prepare(solver, arrow, who=Shape((0.075 * SQUARE + [0.275, 0.2],))).goal.cloud
    assert chosen.x[:, 1].max() <= 0.275
    assert len(chosen.x) == pytest.approx(solver.particle_count / 2, rel=0.02)


@pytest.mark.needs("svgpathtools", "shapes")
def test_a_path_of_svg_is_a_shape() -> None:
    # A square with a hole, once relative and once absolute; y points down in SVG.
    for path in ("M0,0 h4 v4 h-4 z m1 1 h1 v1 h-1 z", "M 0 0 L 4 0 4 4 H 0 Z M1 1 2 1 V2 L1 2Z"):
        shape = shape_of_path(path, (0.5, 0.4), 0.4)
        assert shape.area == pytest.approx(0.4**2 * 15 / 16, rel=1e-3)
        assert shape.covers(np.array([[0.45, 0.45], [0.45, 0.35]])).tolist() == [False, True]
    # A disc of four curves; those that continue others smoothly say less.
    k = 0.5522847
    disc = f"M1 0C1 {k} {k} 1 0 1S-1 {k} -1 0S{-k} -1 0 -1S1 {-k} 1 0z"
    assert shape_of_path(disc, (0.5, 0.5), 0.2).area == pytest.approx(np.pi * 0.1**2, rel=5e-3)
    arcs = "M-1 0 A1 1 0 0 1 1 0 A1 1 0 0 1 -1 0"
    assert shape_of_path(arcs, (0.5, 0.5), 0.2).area == pytest.approx(np.pi * 0.1**2, rel=5e-3)
    parabola = shape_of_path("M0 0Q1 2 2 0T4 0", (0.5, 0.5), 0.2)
    assert parabola.bounds[1][0] - parabola.bounds[0][0] == pytest.approx(0.4, rel=0.01)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("", "it encloses nothing"),
        ("M0 0 L1 0", "it encloses nothing"),
        ("M0 0 L1 1 Z", "it encloses nothing"),
        ("3 4", "cannot be read"),
        ("M0 0 L1 0 2", "expects 2 values"),
    ],
)
@pytest.mark.needs("svgpathtools", "shapes")
def test_what_is_no_path_is_refused(path: str, message: str) -> None:
    with pytest.raises(SketchError, match=re.escape(message)):
        shape_of_path(path, (0.5, 0.5), 0.2)

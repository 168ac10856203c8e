"""The requirements of a sketch: places for all particles, paths to them, and what these take."""

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import (
    Ball,
    BallObstacle,
    Box,
    BoxObstacle,
    ConfigError,
    MpmSolver,
    Scene,
    SegmentObstacle,
    SketchError,
    _native,
)
from hybridmpm.control import Arrow, Ellipse, prepare
from hybridmpm.control.goal.paths import Motion, arrow_path
from hybridmpm.control.goal.region import Fill, Oval


def _solver(dim: int = 2, **more: Any) -> MpmSolver:
    """Return a block of water at rest in the lower left of a box."""
    lower, upper = (0.2, 0.2, 0.4)[:dim], (0.35, 0.35, 0.55)[:dim]
    body = Box(lower=lower, upper=upper, material="water", velocity=more.pop("velocity", (0.0,) * dim))
    return MpmSolver(Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=[body], **more))


def _oval(x: float, y: float, a: float = 0.1, b: float = 0.075, **more: Any) -> Ellipse:
    return Ellipse(np.array([x, y]), np.array([a, b]), **{"angle": 0.4} | more)


@pytest.mark.parametrize("dim", [2, 3])
def test_every_particle_gets_a_place_of_its_own_in_the_oval(dim: int) -> None:
    solver = _solver(dim)
    goal = prepare(solver, _oval(0.6, 0.6)).goal
    places = goal.paths.places
    assert places.shape == (solver.particle_count, dim)
    assert len(np.unique(places, axis=0)) == len(places)
    inside = goal.inside(places)
    assert inside.all()
    # Evenly: the mean is the centre, the covariance that of a filled ellipse or ellipsoid.
    region = goal.region
    np.testing.assert_allclose(places.mean(axis=0)[:2], [0.6, 0.6], atol=2e-3)
    level = region.figure.level(places) / region.scale
    assert np.mean(level**2) == pytest.approx(dim / (dim + 2), abs=0.02)


def test_the_number_of_frames_that_is_chosen_can_be_limited() -> None:
    solver = _solver()
    free = prepare(solver, _oval(0.6, 0.6), hold=10)
    assert prepare(solver, _oval(0.6, 0.6), hold=10, most=free.total_frames).frames == free.frames
    assert prepare(solver, _oval(0.6, 0.6), hold=10, most=30).frames == 20
    assert prepare(solver, _oval(0.6, 0.6), hold=10, most=30).needs().frames == 20
    with pytest.raises(ConfigError, match="most must be"):
        prepare(solver, _oval(0.6, 0.6), hold=10, most=10)


def test_an_oval_smaller_than_the_fluid_is_grown_in_the_same_shape() -> None:
    solver = _solver()
    guidance = prepare(solver, _oval(0.6, 0.6, 0.05, 0.04))
    needs = guidance.needs()
    # Settled fluid takes 3 % more room than at rest.
    assert needs.scale == pytest.approx(
        np.sqrt(1.03 * guidance.goal.cloud.volume / (np.pi * 0.05 * 0.04)), rel=0.01
    )
    assert f"grown to {needs.scale:.2f} times" in str(needs)
    places = guidance.goal.paths.places
    drawn = guidance.goal.inside_drawn(places)
    assert drawn.mean() == pytest.approx(needs.scale**-2, abs=0.02)


@pytest.mark.parametrize("show_all", [False, True])
def test_few_particles_stand_for_the_volume_of_all(show_all: bool) -> None:  # noqa: FBT001 - a parameter
    few = MpmSolver(_solver().scene, r_p=1 / 8, show_all=show_all)
    assert prepare(few, _oval(0.6, 0.6)).goal.cloud.volume == pytest.approx(0.15**2, rel=0.05)


def test_an_oval_larger_than_the_fluid_is_filled_or_shrunk() -> None:
    solver, sketch = _solver(), _oval(0.6, 0.6, 0.2, 0.15)
    filled, shrunk = (prepare(solver, sketch, fill=fill) for fill in ("even", "shrink"))
    assert filled.needs().scale == 1
    room = 1.03 * shrunk.goal.cloud.volume
    assert shrunk.needs().scale == pytest.approx(np.sqrt(room / (np.pi * 0.2 * 0.15)), rel=0.01)
    spread = [guidance.goal.paths.places.std(axis=0).max() for guidance in (filled, shrunk)]
    assert spread[1] == pytest.approx(spread[0] * shrunk.needs().scale, rel=0.02)


def test_walls_and_obstacles_take_their_part_of_the_oval() -> None:
    obstacle = BoxObstacle(lower=(0.6, 0.1), upper=(0.9, 0.4))
    guidance = prepare(_solver(obstacles=[obstacle]), _oval(0.62, 0.45, 0.15, 0.15))
    places = guidance.goal.paths.places
    assert not ((places > [0.6, 0.1]) & (places < [0.9, 0.4])).all(axis=1).any()
    assert guidance.needs().taken == pytest.approx(0.22, abs=0.06)
    beyond = prepare(_solver(), _oval(0.9, 0.5, 0.1, 0.1))
    assert beyond.goal.paths.places[:, 0].max() <= 0.9
    assert beyond.needs().taken == pytest.approx(0.5, abs=0.05)
    assert beyond.needs().scale > 1


def test_ways_lead_around_obstacles() -> None:
    ramp = SegmentObstacle(start=(0.1, 0.45), end=(0.7, 0.45), thickness=0.04)
    goal = prepare(_solver(obstacles=[ramp]), _oval(0.3, 0.7)).goal
    corners, starts = goal.paths.corners, goal.paths.starts
    assert (np.diff(starts) > 2).all()
    for first, last in itertools.pairwise(starts):
        way = corners[first:last]
        crossing = way[np.argmax(way[:, 0])]
        assert crossing[0] > 0.7
    assert not goal.paths.cut_off.any()


def test_a_goal_behind_an_obstacle_is_aimed_at_early_if_the_cap_allows(motions: list[Motion]) -> None:
    ramp = SegmentObstacle(start=(0.1, 0.45), end=(0.7, 0.45), thickness=0.04)
    behind, free = _solver(obstacles=[ramp]), _solver()

    def end(solver: MpmSolver, **settings: Any) -> float:
        prepare(solver, _oval(0.3, 0.7), frames=200, **settings)
        return float(motions[-1].times.max() / (200 * solver.scene.frame_dt))

    assert end(behind) == pytest.approx(0.85, abs=1e-3)
    assert end(behind, cap=3.0) == pytest.approx(1.0, abs=1e-3)
    assert end(free) == pytest.approx(1.0, abs=1e-3)


def test_a_goal_behind_an_obstacle_without_a_gap_is_out_of_reach() -> None:
    ramp = SegmentObstacle(start=(0.05, 0.45), end=(0.95, 0.45), thickness=0.04)
    needs = prepare(_solver(obstacles=[ramp]), _oval(0.5, 0.7)).needs()
    assert not needs.reachable
    assert [one.reason for one in needs.obstructions] == ["obstacle"]
    assert "100 % of the fluid" in str(needs)


def test_the_need_is_the_formula() -> None:
    """A body that an arrow moves by d in T seconds takes |6 d/T^2 - 4 u/T - g| at first."""
    solver = _solver(velocity=(0.5, -1.0))
    needs = prepare(solver, Arrow(np.array([[0.3, 0.3], [0.6, 0.5]])), frames=80).needs()
    d, u, g, seconds = np.array([0.3, 0.2]), np.array([0.5, -1.0]), np.array([0.0, -9.81]), 0.2
    first = 6 * d / seconds**2 - 4 * u / seconds - g
    last = -6 * d / seconds**2 + 2 * u / seconds - g
    largest = max(np.linalg.norm(first), np.linalg.norm(last))
    assert needs.acceleration == pytest.approx(largest / 9.81, rel=1e-4)
    mean_square = (first @ first + first @ last + last @ last) / 3
    assert needs.rms == pytest.approx(np.sqrt(mean_square) / 9.81, rel=1e-4)


def test_frames_are_chosen_from_the_need() -> None:
    solver = _solver()
    near, far = (prepare(solver, _oval(x, x)) for x in (0.35, 0.75))
    assert near.frames < far.frames
    assert far.needs().acceleration < 5.01
    weak = prepare(solver, _oval(0.75, 0.75), cap=3.0)
    assert weak.frames > far.frames
    assert weak.needs().acceleration <= 2.01


def test_too_little_time_and_too_low_a_cap_are_told() -> None:
    solver, sketch = _solver(), _oval(0.7, 0.7)
    hurried = prepare(solver, sketch, frames=30).needs()
    assert [one.reason for one in hurried.obstructions] == ["time"]
    assert "frames would do" in str(hurried)
    weak = prepare(solver, sketch, cap=0.5).needs()
    assert [one.reason for one in weak.obstructions] == ["cap"]
    assert "raise the cap" in str(weak)


def test_strength_scales_the_cap() -> None:
    assert prepare(_solver(), _oval(0.6, 0.6), cap=10.0, strength=0.4).needs().cap == pytest.approx(4.0)


def test_nothing_moves_and_equal_input_gives_equal_plans() -> None:
    solver = _solver()
    before = solver.snapshot()
    first, second = (prepare(solver, _oval(0.6, 0.6)) for _ in range(2))
    assert solver.snapshot() == before
    assert np.array_equal(first.goal.paths.places, second.goal.paths.places)


@pytest.mark.parametrize("center", [(0.05, 0.05), (0.75, 0.25)])
def test_an_oval_without_a_free_part_is_refused(center: tuple[float, float]) -> None:
    obstacle = BoxObstacle(lower=(0.6, 0.1), upper=(0.9, 0.4))
    with pytest.raises(SketchError, match="no part of the oval is free"):
        prepare(_solver(obstacles=[obstacle]), _oval(*center, 0.03, 0.02))


def test_an_oval_far_smaller_than_a_particle_is_grown_too() -> None:
    goal = prepare(_solver(), _oval(0.5, 0.5, 2 / 512, 2 / 512)).goal
    np.testing.assert_allclose(goal.paths.places.mean(axis=0), [0.5, 0.5], atol=3e-3)


_HARD = [
    ("far larger than the fluid", (0.39, 0.39), (0.5, 0.5), "shrink"),
    ("a needle through the room", (0.3, 2 / 512), (0.5, 0.5), "even"),
    ("a needle on the floor", (0.3, 2 / 512), (0.15, 0.105), "even"),
    ("nearly all outside of the walls", (0.1, 0.1), (0.01, 0.5), "shrink"),
    ("in a crack between obstacles", (2 / 512, 2 / 512), (0.6025, 0.5), "even"),
]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    ("axes", "center", "fill"), [one[1:] for one in _HARD], ids=[one[0] for one in _HARD]
)
def test_the_search_for_room_takes_few_points_whatever_was_drawn(
    monkeypatch: pytest.MonkeyPatch,
    dim: int,
    axes: tuple[float, float],
    center: tuple[float, float],
    fill: Fill,
) -> None:
    """A raster of the whole room took millions of points, and seconds."""
    looked_at = 0
    level = Oval.level

    def counted(oval: Oval, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        nonlocal looked_at
        looked_at += len(x)
        return level(oval, x)

    monkeypatch.setattr(Oval, "level", counted)
    solids = [
        BoxObstacle(lower=(left, 0.1, 0.1)[:dim], upper=(right, 0.9, 0.9)[:dim])
        for left, right in [(0.4, 0.6), (0.605, 0.9)]
    ]
    solver = _solver(dim, obstacles=solids if center[0] > 0.6 else [])
    region = prepare(solver, _oval(*center, *axes, angle=0.7), method="none", fill=fill).goal.region
    assert region.volume >= 0.99 * 1.03 * solver.particle_count * solver.scene.spacing**dim
    assert looked_at <= 300 * solver.particle_count


@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize("fill", ["even", "shrink"])
@pytest.mark.parametrize("dim", [2, 3])
def test_no_free_cell_of_the_region_is_missed(dim: int, fill: Fill, angle: float) -> None:
    ball = BallObstacle(center=(0.45, 0.3, 0.5)[:dim], radius=0.1)
    solver = _solver(dim, obstacles=[ball])
    region = prepare(solver, _oval(0.5, 0.15, 0.25, 0.03, angle=angle), method="none", fill=fill).goal.region
    side = (region.volume / len(region.cells)) ** (1 / dim)
    axis = 0.1 + side * (np.arange(round(0.8 / side)) + 0.5)
    lattice = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    # Cells on the very rim may round to either side.
    inside = lattice[region.reaches(lattice, region.scale * (1 - 1e-9))]
    kept = region.cells[region.figure.level(region.cells) <= region.scale * (1 - 1e-9)]
    mine, all_there = (cells[np.lexsort(cells.T.round(9))] for cells in (kept, inside))
    np.testing.assert_allclose(mine, all_there, atol=1e-9)


def test_an_arrow_of_any_number_of_bends_has_few_corners() -> None:
    """Timing a way takes time with the square of its corners: minutes, for a scribble of 4096 points."""
    scribble = Arrow(np.random.default_rng(0).uniform(0.15, 0.85, (4096, 2)))
    path = arrow_path(scribble, 2, _solver().scene.walls, 1.0)
    assert len(path) <= 72
    np.testing.assert_allclose(path[-1], scribble.points[-1] - scribble.points[0])
    # Those that are kept tell of the scribble's extent.
    np.testing.assert_allclose(np.ptp(path, axis=0), np.ptp(scribble.points, axis=0), rtol=0.1)


def test_an_arrow_carries_the_shape_along() -> None:
    solver = _solver()
    goal = prepare(solver, Arrow(np.array([[0.3, 0.3], [0.6, 0.5]]))).goal
    np.testing.assert_allclose(
        goal.paths.places - solver.positions, np.tile([0.3, 0.2], (len(goal.cloud.x), 1))
    )
    assert goal.inside(goal.paths.places) is None


def test_a_shape_without_room_at_the_tip_becomes_a_disc_around_it() -> None:
    pool = MpmSolver(
        Scene(dim=2, resolution=64, bodies=[Box(lower=(0.1, 0.1), upper=(0.9, 0.16), material="water")])
    )
    goal = prepare(pool, Arrow(np.array([[0.5, 0.2], [0.6, 0.5]]))).goal
    np.testing.assert_allclose(
        goal.paths.places.mean(axis=0), np.add(pool.positions.mean(axis=0), [0.1, 0.3]), atol=0.01
    )
    assert goal.paths.places[:, 0].max() < 0.9
    inside = goal.inside(goal.paths.places)
    assert inside.all()


def test_an_arrow_out_of_the_room_is_told() -> None:
    solver = MpmSolver(
        Scene(dim=2, resolution=64, bodies=[Ball(center=(0.8, 0.8), radius=0.05, material="water")])
    )
    guidance = prepare(solver, Arrow(np.array([[0.1, 0.1], [0.9, 0.9]])))
    assert guidance.goal.paths.places.max() <= 0.9
    assert [one.reason for one in guidance.needs().obstructions] == ["wall"]


def test_depth_comes_from_widths() -> None:
    solver = _solver(3)
    oval = prepare(solver, _oval(0.6, 0.6, width=11.0)).goal
    np.testing.assert_allclose(oval.paths.places.mean(axis=0), [0.6, 0.6, 0.5], atol=5e-3)
    drawn = oval.drawn
    assert drawn.axes[2] == pytest.approx(np.sqrt(0.1 * 0.075))
    arrow = Arrow(np.array([[0.3, 0.3], [0.5, 0.5]]), np.array([8.0, 12.5]))
    assert prepare(solver, arrow).goal.target_displacement[2] == pytest.approx(0.8 * 4.5 / 18)


def test_a_trembling_straight_stroke_is_straight() -> None:
    rng = np.random.default_rng(5)
    line = np.linspace([0.2, 0.3], [0.6, 0.5], 200) + rng.normal(scale=0.002, size=(200, 2))
    walls = Scene(dim=2, bodies=_solver().scene.bodies).walls
    assert len(arrow_path(Arrow(line), 2, walls, 1.0)) == 2
    bent = np.concatenate([line, np.linspace(line[-1], [0.6, 0.8], 100)])
    path = arrow_path(Arrow(bent), 2, walls, 1.0)
    assert 8 <= len(path) <= 14
    distance = np.linalg.norm(bent[:, None] - bent[0] - path[None], axis=2)
    assert distance.min(axis=0).max() < 0.01


def test_a_region_is_matched_exactly_as_often_as_asked() -> None:
    rng = np.random.default_rng(1)
    x, cells = rng.random((900, 2)), rng.random((9000, 2))
    first, second = (_native.match_to_region(x, cells) for _ in range(2))
    assert np.array_equal(first.places, second.places)
    assert np.array_equal(np.bincount(first.group), np.bincount(second.group))

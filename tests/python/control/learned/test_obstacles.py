"""The method "learned" among obstacles: what the network sees of them, and ways around them."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridmpm import MpmSolver, Scene, scenarios
from hybridmpm.control import Arrow, Ellipse, Guidance, follow, prepare
from hybridmpm.control.goal.cloud import Cloud
from hybridmpm.control.goal.paths import Motion
from hybridmpm.control.goal.room import Room
from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.learned.features import SCALE, Aim, State, channels, distances, inputs
from hybridmpm.control.methods.learned.plan import Learned
from hybridmpm.control.methods.learned.spec import CELLS

NetworkFile = Callable[..., Path]
POST = {"shape": "box", "lower": [0.46, 0.1], "upper": [0.54, 0.4]}
BEYOND = Arrow(np.array([[0.3, 0.3], [0.7, 0.3]]))
UPPER = Ellipse(np.array([0.7, 0.3]), np.array([0.14, 0.1]), 0.0)


def scene_with(*obstacles: dict[str, Any], dim: int = 2) -> Scene:
    """Return water on the left."""
    block = {"shape": "box", "material": "water", "lower": [0.15, 0.12], "upper": [0.35, 0.3]}
    if dim == 3:
        block |= {"lower": [0.15, 0.12, 0.4], "upper": [0.35, 0.3, 0.5]}
    return Scene.parse({"dim": dim, "bodies": [block], "obstacles": list(obstacles)})


def state_of(scene: Scene) -> State:
    cloud, room = Cloud.of(MpmSolver(scene)), Room(scene, 0.0)
    sand = np.zeros(len(cloud.x), dtype=bool)
    volume = scene.spacing**scene.dim
    return State(
        cloud.x, cloud.v, sand, cloud.weight, volume, room.lower, room.upper, cloud.gravity, distances(room)
    )


def seen_of(scene: Scene) -> np.ndarray[Any, Any]:
    """Return the two channels (K, 2, C, C) of obstacles on each plane."""
    one = state_of(scene)
    aim = Aim(np.full(scene.dim, 0.5), np.diag([0.1, 0.1]), 0.25)
    with_them, without = (inputs([one], [aim], [None], obstacles=seen).grid[0] for seen in (True, False))
    count = channels(scene.dim, obstacles=True)
    planes = with_them.reshape(-1, count, CELLS, CELLS)
    np.testing.assert_array_equal(planes[:, : count - 2].reshape(without.shape), without)
    return planes[:, count - 2 :]


def test_a_network_sees_fill_and_nearness_of_obstacles() -> None:
    taken, near = seen_of(scene_with(POST))[0]
    cell = 0.8 / CELLS
    assert taken.sum() * cell**2 == pytest.approx(0.08 * 0.3, rel=0.06)
    rows, columns = np.nonzero(taken > 0.99)
    x, y = 0.1 + (columns + 0.5) * cell, 0.1 + (rows + 0.5) * cell
    assert x.min() > 0.46
    assert x.max() < 0.54
    assert y.max() < 0.4
    assert near.max() == 1
    assert (near[taken == 1] == 1).all()
    beside = near[4]  # a row of cells below the top of the post
    away = np.maximum(0.46 - (0.1 + (np.arange(CELLS) + 0.5) * cell), 0)
    left = away > 0
    np.testing.assert_allclose(beside[left], np.clip(1 - away[left] / SCALE, 0, 1), atol=1e-5)


def test_open_space_is_nothing_to_see() -> None:
    assert not seen_of(scene_with()).any()


def test_a_plane_in_3d_shows_the_share_of_a_column() -> None:
    """A block through half of the depth takes half of each column in the front view, and all from above."""
    half = {"shape": "box", "lower": [0.5, 0.1, 0.1], "upper": [0.7, 0.4, 0.5]}
    front, side, above = seen_of(scene_with(half, dim=3))[:, 0]
    cell = 0.8 / CELLS
    row, column = int(0.1 / cell), int(0.5 / cell)  # y = 0.2 and x = 0.6
    assert front[row, column] == pytest.approx(0.5, abs=0.04)
    assert side[row, int(0.2 / cell)] == pytest.approx(0.25, abs=0.04)
    assert above[int(0.2 / cell), column] == pytest.approx(0.375, abs=0.04)
    assert above[int(0.6 / cell), column] == 0


def planned(scene: Scene, path: Path, sketch: Any, **settings: Any) -> Guidance:
    solver = MpmSolver(scene)
    solver.advance(5)
    return prepare(solver, sketch, method=Learned(str(path)), **{"frames": 150, **settings})


@pytest.mark.parametrize("sketch", [UPPER, BEYOND])
def test_ways_lead_around_a_post(sketch: Any, network_file: NetworkFile, motions: list[Motion]) -> None:
    """The network by hand keeps the shape, so straight ways would lead through the post."""
    scene = scene_with(POST)
    guidance = planned(scene, network_file(scenario="water_ramps_2d"), sketch)
    assert guidance.method == "learned", guidance.reason
    corners, starts = motions[-1].paths.corners, motions[-1].paths.starts.astype(int)
    room = Room(scene, 0.0)
    straight = np.linspace(corners[starts[:-1]], corners[starts[1:] - 1], 40)
    assert (room.distance(straight.reshape(-1, 2)) < 0).reshape(40, -1).any(axis=0).mean() > 0.5
    gone = [
        np.linspace(a, b, 20)
        for first, last in itertools.pairwise(starts)
        for a, b in zip(corners[first : last - 1], corners[first + 1 : last], strict=True)
    ]
    assert (room.distance(np.concatenate(gone)) > -1e-6).all()


def test_an_oval_among_obstacles_is_filled_unless_that_tears_the_fluid(network_file: NetworkFile) -> None:
    """Places are those of the analytic plan; who goes where is the network's."""
    large = Ellipse(np.array([0.7, 0.45]), np.array([0.19, 0.15]), 0.0)
    for sketch, is_filled in ((UPPER, True), (large, False)):
        guidance = planned(scene_with(POST), network_file(scenario="water_ramps_2d"), sketch)
        assert guidance.method == "learned", guidance.reason
        assert isinstance(guidance.law, Tracked)
        found = guidance.law.places
        filled = guidance.goal.paths.places
        away = np.linalg.norm(found[:, None] - filled[None], axis=2).min(axis=1)
        assert guidance.goal.is_torn is not is_filled
        assert (np.quantile(away, 0.99) < 1e-3) == is_filled


def test_fluid_arrives_behind_a_post(network_file: NetworkFile) -> None:
    solver = MpmSolver(scene_with(POST))
    solver.advance(5)
    result = follow(solver, UPPER, Learned(str(network_file(scenario="water_ramps_2d"))), frames=150).run()
    assert (result.positions[-1][:, 0] > 0.54).mean() > 0.9


def test_a_plan_without_a_way_hands_over(network_file: NetworkFile) -> None:
    wall = {"shape": "box", "lower": [0.46, 0.0], "upper": [0.54, 1.0]}
    guidance = planned(scene_with(wall), network_file(scenario="water_ramps_2d"), UPPER)
    assert guidance.method == "analytic"
    assert guidance.reason.endswith("the plan leads 100 % of the fluid through obstacles")


def test_a_plan_that_ends_in_obstacles_hands_over(network_file: NetworkFile) -> None:
    """Of an oval whose upper half is taken, half of the places of the network lie in what takes it."""
    over = {"shape": "box", "lower": [0.5, 0.32], "upper": [0.9, 0.6]}
    guidance = planned(scene_with(over), network_file(scenario="water_ramps_2d"), UPPER)
    assert guidance.method == "analytic"
    assert "% of the fluid in obstacles" in guidance.reason


@pytest.mark.parametrize("dim", [2, 3])
def test_points_in_obstacles_are_freed_to_the_nearest_surface(dim: int) -> None:
    ball = {"shape": "ball", "center": [0.6, 0.5, 0.5][:dim], "radius": 0.15}
    room = Room(scene_with(ball, dim=dim), 0.0)
    points = np.random.default_rng(0).uniform(0.05, 0.95, (400, dim))
    freed = room.freed(points)
    assert room.is_free(freed).all()
    inside = room.within_walls(points) & (room.distance(points) < -1e-3)
    gone = np.linalg.norm(freed - points, axis=1)
    np.testing.assert_allclose(gone[inside], -room.distance(points[inside]), atol=3e-3)
    np.testing.assert_array_equal(freed[room.is_free(points)], points[room.is_free(points)])


def test_samples_are_mirrored_with_their_obstacles() -> None:
    from hybridmpm.training.control.pasts import Past
    from hybridmpm.training.control.transport.windows import drawn

    past = Past.simulated(scenarios.get("water_ramps_2d", 3))
    rng, cell = np.random.default_rng(0), 0.8 / CELLS
    whole, mirrored = past.state(0).distance, 0
    assert whole is not None
    for _ in range(12):
        state = drawn(rng, [past], shortest=0.1, longest=0.4).state
        assert state.distance is not None
        nodes = np.clip(((state.x - state.lower) / cell).astype(int), 0, CELLS - 1)
        # No particle is deeper in an obstacle than a cell is wide.
        assert state.distance[tuple(nodes.T)].min() > -cell
        mirrored += np.array_equal(state.distance, whole[::-1])
        assert np.array_equal(state.distance, whole) or np.array_equal(state.distance, whole[::-1])
    assert 0 < mirrored < 12


def test_obstacles_are_no_part_of_a_state_in_the_open() -> None:
    assert state_of(scene_with()).distance is None
    assert replace(state_of(scene_with(POST))).distance is not None

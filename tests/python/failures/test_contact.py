"""Obstacles, walls and other bodies: nothing passes, nothing welds, friction is what was asked for."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    BallObstacle,
    Box,
    BoxObstacle,
    Elastic,
    HalfSpaceObstacle,
    MpmSolver,
    Scene,
    SegmentObstacle,
    ThinObstacleWarning,
    Walls,
    Water,
    _native,
    scenarios,
)

Build = Callable[..., _native.Solver]

RESOLUTION = 48
DX = 1 / RESOLUTION
SPEED = 5.0
"""Of what flies at an obstacle, with CFL number 0.9."""
SOUND = 0.45 / 0.9 * SPEED
"""Speed that stiffness allows at a CFL number of 0.45, the default of water."""


def soft(material: str, dim: int) -> _native.Material:
    """Material whose `signal speed` in the sense of `Material.signal_speed` is SOUND."""
    if material == "water":
        return _native.Material.water(density=1000.0, bulk_modulus=1000 * SOUND**2 / dim)
    # (D lambda + 2 mu) / E for Poisson's ratio 0.2.
    modulus = 1000 * SOUND**2 / (dim / 3.6 + 1 / 1.2)
    return _native.Material.sand(
        density=1000.0, youngs_modulus=modulus, poisson_ratio=0.2, friction_angle=35.0
    )


def obstacle(shape: str, at: Any, heading: Any, thickness: float) -> _native.Obstacle:
    """Obstacle through the point `at` across the heading."""
    if shape == "ball":
        return _native.Obstacle.ball(at, thickness / 2)
    if shape == "ramp":
        along = 0.7 * np.array([-heading[1], heading[0]])
        return _native.Obstacle.segment(at - along, at + along, thickness)
    lower, upper = np.zeros(len(at)), np.ones(len(at))
    axis = int(np.argmax(np.abs(heading)))
    lower[axis], upper[axis] = at[axis] - thickness / 2, at[axis] + thickness / 2
    return _native.Obstacle.box(lower, upper)


def fly(
    build: Build, material: str, shape: str, heading: Any, *, offset: float, cells: float, alone: bool
) -> tuple[int, float]:
    """Shoot a block or single particles at an obstacle; (particles behind it, deepest inside in cells)."""
    dim = len(heading)
    heading = np.array(heading) / np.linalg.norm(heading)
    at = np.full(dim, 0.5) + offset * DX
    across = np.linalg.qr(np.column_stack([heading, np.eye(dim)[:, : dim - 1] + 0.1]))[0][:, 1:]
    if alone:
        rng = np.random.default_rng(int(100 * offset))
        reach = 0.1 * DX if shape == "ball" else 0.3
        x = rng.uniform(-reach, reach, (30, dim - 1)) @ across.T - rng.uniform(0.1, 0.15, (30, 1)) * heading
    else:
        side = np.arange(-2.75, 3, 0.5) * DX
        grid = np.stack(np.meshgrid(*[side] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
        x = grid @ np.column_stack([heading, across]).T - (6 * DX + cells * DX / 2) * heading
    x = at + x[((at + x > 0.11) & (at + x < 0.89)).all(axis=1)]
    solid = obstacle(shape, at, heading, cells * DX)
    solver = build(
        x,
        SPEED * heading,
        soft(material, dim),
        resolution=RESOLUTION,
        frame_dt=0.9 * DX / SPEED,
        obstacles=[solid],
        substeps=1,
        allow_unstable=True,
    )
    deepest = 0.0
    for _ in range(22):
        solver.advance()
        deepest = max(deepest, float(-solid.signed_distance(solver.positions).min()))
    behind = (solver.positions - at) @ heading > 0
    # What flows around a ball is behind it too: there, only getting inside counts.
    return 0 if shape == "ball" else int(behind.sum()), deepest / DX


FLIGHTS: list[tuple[str, tuple[float, ...]]] = [
    *[("box", heading) for heading in ((1, 0), (-1, 0), (0, 1), (0, -1), (0, 1, 0), (0, 0, -1), (-1, 0, 0))],
    *[("ramp", heading) for heading in ((1, 0), (0, -1), (1, 1), (-1, -1), (1, -0.4), (-0.3, 0.9))],
    *[("ball", heading) for heading in ((1, 0), (0, -1), (-1, -1), (1, 1, 1), (-0.5, -1, -0.2))],
]


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("cells", [2, 3])
@pytest.mark.parametrize("material", ["water", "sand"])
def test_nothing_passes_an_obstacle_of_two_cells_at_cfl_0_9(
    build: Build, material: str, cells: int, *, alone: bool
) -> None:
    for shape, heading in FLIGHTS:
        for offset in (0.0, 0.3, 0.7):
            behind, deepest = fly(build, material, shape, heading, offset=offset, cells=cells, alone=alone)
            assert behind == 0, (shape, heading, offset)
            assert deepest < 1e-4, (shape, heading, offset)


def test_an_obstacle_of_a_quarter_of_a_cell_lets_fast_particles_through(build: Build) -> None:
    """The reason for `ThinObstacleWarning`."""
    flights = [fly(build, "sand", "box", (1, 0), offset=o, cells=0.25, alone=True) for o in (0.0, 0.3, 0.7)]
    assert sum(behind for behind, _ in flights) > 0


@pytest.mark.parametrize("axis", [0, 1])
def test_nothing_passes_between_a_wall_and_a_box_that_ends_on_it(axis: int) -> None:
    """What got into the end of a box was once put back to its face on the wall, and ran down there."""
    lower, upper, start, end = [0.1, 0.1], [0.9, 0.9], [0.4, 0.1], [0.6, 0.3]
    lower[1 - axis], upper[1 - axis] = 0.36, 0.4
    start[1 - axis], end[1 - axis] = 0.55, 0.75
    velocity = [0.0, 0.0]
    velocity[1 - axis] = -4.0
    water = Box(material="water", lower=start, upper=end, velocity=velocity)
    solver = MpmSolver(
        Scene(dim=2, resolution=96, bodies=(water,), obstacles=(BoxObstacle(lower=lower, upper=upper),))
    )
    solver.advance(240)
    assert solver.positions[:, 1 - axis].min() > 0.39


BODY = Box(material="water", lower=(0.2, 0.7), upper=(0.3, 0.8))


@pytest.mark.parametrize(
    ("thin", "thickness"),
    [
        (SegmentObstacle(start=(0.2, 0.3), end=(0.8, 0.3), thickness=0.007), "0.007"),
        (BoxObstacle(lower=(0.2, 0.3), upper=(0.8, 0.305)), "0.005"),
        (BallObstacle(center=(0.5, 0.3), radius=0.003), "0.006"),
    ],
)
def test_thin_obstacles_are_warned_of(thin: Any, thickness: str) -> None:
    scene = Scene(dim=2, resolution=64, bodies=(BODY,), obstacles=(thin,))
    message = (
        rf"obstacles\[0\] \({thin.shape}\) is {thickness} m thick, less than 0.5 cells of 0.0156 m.*0.00781 m"
    )
    with pytest.warns(ThinObstacleWarning, match=message) as caught:
        MpmSolver(scene)
    assert caught[0].filename == __file__


def test_obstacles_of_half_a_cell_are_not_warned_of() -> None:
    solids = (
        SegmentObstacle(start=(0.2, 0.3), end=(0.8, 0.3), thickness=0.5 / 64),
        BoxObstacle(lower=(0.5, 0.5), upper=(0.5 + 0.5 / 64, 0.6)),
        BallObstacle(center=(0.5, 0.3), radius=0.25 / 64),
        HalfSpaceObstacle(point=(0.5, 0.15), normal=(0.1, 1.0)),
    )
    assert Scene(dim=2, resolution=64, bodies=(BODY,), obstacles=solids).thin_obstacles() == []


@pytest.mark.parametrize("name", scenarios.NAMES)
def test_scenarios_have_no_thin_obstacle(name: str) -> None:
    assert [scenarios.get(name, seed).thin_obstacles() for seed in range(30)] == [[]] * 30


def test_jelly_blocks_part_after_they_have_met() -> None:
    left = Box(material="elastic", lower=(0.2, 0.4), upper=(0.4, 0.6), velocity=(1.0, 0.0))
    right = Box(material="elastic", lower=(0.6, 0.4), upper=(0.8, 0.6), velocity=(-1.0, 0.0))
    scene = Scene(dim=2, resolution=64, gravity=(0.0, 0.0), bodies=(left, right))
    solver, body = MpmSolver(scene), scene.sample().body

    def gap() -> float:
        x = solver.positions[:, 0]
        return float((x[body == 1].min() - x[body == 0].max()) / scene.dx)

    solver.advance(40)
    assert gap() < 2, "they have met"
    solver.advance(60)
    # They meet where their faces are, two cells nearer than nodes would let them, and so part later.
    assert gap() > 12
    assert np.mean(solver.velocities[body == 0, 0]) < -0.8


def test_water_leaves_a_vertical_wall() -> None:
    """It neither hangs on the wall while it falls nor follows the wall when pulled away."""
    body = Box(material="water", lower=(0.1, 0.3), upper=(0.2, 0.6))
    falling = MpmSolver(Scene(dim=2, resolution=64, bodies=(body,)))
    start = falling.positions
    falling.advance(20)
    fallen = (start - falling.positions)[:, 1]
    np.testing.assert_allclose(fallen[start[:, 0] < 0.12], 9.81 * 0.05**2 / 2, rtol=0.02)
    pulled = MpmSolver(Scene(dim=2, resolution=64, gravity=(2.0, 0.0), bodies=(body,)))
    pulled.advance(40)
    np.testing.assert_allclose(pulled.positions[:, 0] - start[:, 0], 2.0 * 0.1**2 / 2, rtol=0.02)


@pytest.mark.parametrize("place", ["wall", "obstacle"])
@pytest.mark.parametrize(
    ("contact", "friction", "own", "expected"),
    [
        ("separating", 0.2, 0.9, 3.0 - 0.2 * 9.81),
        ("separating", None, 0.1, 3.0 - 0.1 * 9.81),
        ("separating", 0.5, 0.0, 0.0),
        ("slip", None, 0.9, 3.0),
        ("sticky", None, 0.0, 0.0),
    ],
)
def test_each_contact_rubs_as_it_was_told(
    place: str, contact: str, friction: float | None, own: float, expected: float
) -> None:
    """A block is pulled along the floor by 3 m/s^2; `own` is the coefficient of its material."""
    settings: dict[str, Any] = {"contact": contact, "friction": friction}
    floor = 0.1 if place == "wall" else 0.25
    walls, obstacles = Walls(lower=(0.1, 0.1), upper=(0.9, 0.9)), ()
    if place == "wall":
        walls = Walls(lower=(0.1, 0.1), upper=(0.9, 0.9), **settings)
    else:
        obstacles = (BoxObstacle(lower=(0.0, 0.0), upper=(1.0, floor), **settings),)
    jelly = Elastic(youngs_modulus=1e6, wall_friction=own)
    body = Box(material=jelly, lower=(0.2, floor), upper=(0.4, floor + 0.1))
    solver = MpmSolver(
        Scene(dim=2, resolution=64, gravity=(3.0, -9.81), walls=walls, bodies=(body,), obstacles=obstacles)
    )
    solver.advance(80)  # it lands
    early = np.mean(solver.velocities[:, 0])
    solver.advance(80)
    gained = (np.mean(solver.velocities[:, 0]) - early) / 0.2
    assert gained == pytest.approx(expected, abs=0.1)


def test_walls_may_lie_on_the_edge_of_the_world() -> None:
    water = Water(density=2000.0, bulk_modulus=1e5, tension=0.75)
    body = Box(material=water, lower=(0.45, 0.35), upper=(0.68, 0.7), velocity=(-2.0, -0.6))
    walls = Walls(lower=(0.0, 0.0), upper=(1.0, 1.0), friction=0.5)
    scene = Scene(
        dim=2, resolution=34, gravity=(7.5, -20.5), walls=walls, bodies=(body,), particles_per_cell=3
    )
    solver = MpmSolver(scene)
    solver.advance(400)
    assert ((solver.positions >= 0) & (solver.positions <= 1)).all()

"""How well sketches are followed, on scenes that nothing was tuned on; test_follow.py has cheap twins."""

import itertools
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import Box, MpmSolver, Scene, scenarios
from hybridmpm.control import Arrow, Ellipse, Following, follow

pytestmark = pytest.mark.long

SEEDS = range(1000, 1006)


def _oval(rng: np.random.Generator, area: float) -> Ellipse:
    """Draw an oval of 0.7 to 1.6 times the fluid's area, somewhere above the floor."""
    aspect, size = rng.uniform(1, 2.2), area * rng.uniform(0.7, 1.6) / np.pi
    axes = np.sqrt([size * aspect, size / aspect])
    return Ellipse(rng.uniform([0.35, 0.4], [0.65, 0.65]), axes, rng.uniform(0, np.pi))


def _pool(rng: np.random.Generator) -> MpmSolver:
    depth = rng.uniform(0.06, 0.08)
    solver = MpmSolver(
        Scene(dim=2, bodies=[Box(lower=(0.1, 0.1), upper=(0.9, 0.1 + depth), material="water")])
    )
    solver.advance(100)
    return solver


def _sand(rng: np.random.Generator) -> MpmSolver:
    left = rng.uniform(0.1, 0.6)
    solver = MpmSolver(
        Scene(dim=2, bodies=[Box(lower=(left, 0.1), upper=(left + 0.3, 0.3), material="sand")])
    )
    solver.advance(250)
    return solver


def _puddles(rng: np.random.Generator) -> MpmSolver:
    width = rng.uniform(0.15, 0.22)
    height = 0.1 + 0.03 / width
    bodies = [
        Box(lower=(0.1, 0.1), upper=(0.1 + width, height), material="water"),
        Box(lower=(0.9 - width, 0.1), upper=(0.9, height), material="water"),
    ]
    solver = MpmSolver(Scene(dim=2, bodies=bodies))
    solver.advance(60)
    return solver


def _share(following: Following, x: npt.NDArray[np.float32]) -> float:
    inside = following.guidance.goal.inside(x.astype(np.float64))
    assert inside is not None
    return float(following.guidance.goal.cloud.weight @ inside)


@pytest.mark.parametrize("make", [_pool, _sand, _puddles])
def test_free_ovals_hold_the_mass_at_the_end_and_later(
    make: Callable[[np.random.Generator], MpmSolver],
) -> None:
    ends, laters = [], []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        solver = make(rng)
        oval = _oval(rng, solver.particle_count * solver.scene.spacing**2)
        following = follow(solver, oval, hold=20)
        assert following.guidance.needs().reachable
        result = following.run()
        ends.append(_share(following, result.positions[following.guidance.frames]))
        laters.append(_share(following, result.positions[-1]))
    assert np.mean(ends) > 0.99
    assert min(ends) > 0.97
    assert np.mean(laters) > 0.95


@pytest.mark.parametrize("scenario", ["water_ramps_2d", "sand_ramps_2d"])
def test_ovals_over_ramps_hold_most_of_the_mass(scenario: str) -> None:
    ends = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        solver = MpmSolver(scenarios.get(scenario, seed))
        solver.advance(250)
        oval = _oval(rng, solver.particle_count * solver.scene.spacing**2)
        following = follow(solver, oval)
        ends.append(following.run().reached.inside or 0.0)
    assert np.mean(ends) > 0.85


def _flying_blocks() -> Iterator[tuple[MpmSolver, np.random.Generator]]:
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        size, corner = rng.uniform(0.1, 0.2, 2), rng.uniform(0.15, 0.35, 2)
        body = Box(
            lower=tuple(corner),
            upper=tuple(corner + size),
            material=("water", "sand")[seed % 2],
            velocity=tuple(rng.uniform(-1, 1, 2)),
        )
        yield MpmSolver(Scene(dim=2, bodies=[body])), rng


def test_straight_arrows_end_at_the_tip() -> None:
    for solver, rng in _flying_blocks():
        arrow = Arrow(np.array([[0.4, 0.4], rng.uniform(0.5, 0.7, 2)]))
        result = follow(solver, arrow).run()
        assert result.reached.miss < 3e-3
        want = result.target_displacement
        cosine = result.displacement @ want / np.linalg.norm(result.displacement) / np.linalg.norm(want)
        assert np.degrees(np.arccos(min(1.0, cosine))) < 0.5


def test_bent_arrows_are_followed_all_the_way() -> None:
    distances = []
    for solver, rng in _flying_blocks():
        solver.reset()
        legs = rng.uniform([0.15, -0.05], [0.3, 0.05]), rng.uniform([-0.05, 0.15], [0.05, 0.3])
        corners = np.cumsum([[0.3, 0.3], *legs], axis=0)
        drawn = np.concatenate([np.linspace(a, b, 40) for a, b in itertools.pairwise(corners)])
        result = follow(solver, Arrow(drawn + rng.normal(scale=0.001, size=drawn.shape))).run()
        assert result.reached.miss < 3e-3
        path = result.centroids[0] + drawn - drawn[0]
        distance = np.linalg.norm(result.centroids[:, None] - path[None], axis=2).min(axis=1)
        distances.append(distance.mean())
    assert np.mean(distances) < 6e-3


def test_single_bodies_take_little_more_than_the_least_force() -> None:
    ratios = []
    for solver, rng in _flying_blocks():
        oval = _oval(rng, solver.particle_count * solver.scene.spacing**2)
        following = follow(solver, oval)
        ratios.append(following.run().reached.rms / following.guidance.needs().rms)
    assert np.mean(ratios) < 1.1

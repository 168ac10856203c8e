"""How well sketches are followed, on scenes that nothing was tuned on; test_follow.py has cheap twins."""

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from tests.python.control import sketched_scenes as scenes

from hybridmpm import Box, MpmSolver, Scene
from hybridmpm.control import Arrow, follow

pytestmark = pytest.mark.long

SEEDS = range(1000, 1006)


@pytest.mark.parametrize("make", scenes.FREE.values(), ids=scenes.FREE)
def test_free_ovals_hold_the_mass_at_the_end_and_later(make: scenes.Maker) -> None:
    found = [scenes.shares(make, seed) for seed in SEEDS]
    ends, laters = [one.end for one in found], [one.later for one in found]
    assert np.mean(ends) > 0.99
    assert min(ends) > 0.97
    assert np.mean(laters) > 0.95


@pytest.mark.parametrize("make", scenes.OVER_RAMPS.values(), ids=scenes.OVER_RAMPS)
def test_ovals_over_ramps_hold_most_of_the_mass(make: scenes.Maker) -> None:
    assert np.mean([scenes.shares(make, seed).end for seed in SEEDS]) > 0.85


@pytest.mark.parametrize("make", scenes.FREE.values(), ids=scenes.FREE)
def test_a_sketch_that_acts_late_costs_next_to_nothing(make: scenes.Maker) -> None:
    assert np.mean([scenes.lateness(make, seed) for seed in SEEDS]) < 0.01


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
        following = follow(solver, scenes.oval(rng, solver))
        ratios.append(following.run().reached.rms / following.guidance.needs().rms)
    assert np.mean(ratios) < 1.1

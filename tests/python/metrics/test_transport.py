"""The Sinkhorn distance against closed forms."""

import sys

import numpy as np
import pytest

from hybridmpm import ConfigError, SimulationError, metrics
from hybridmpm.metrics import transport

pytestmark = pytest.mark.needs("ot", "metrics")
ONE = np.array([[0.5, 0.5]])


def test_of_two_particles_it_is_their_distance() -> None:
    # Of single points every coupling is the same, so that the divergence is |x - y|^2 = 0.3^2 + 0.4^2.
    assert metrics.sinkhorn_distance([[0.2, 0.1]], [3.0], ONE, [1.0]) == pytest.approx(0.5, rel=1e-6)


def test_of_one_particle_and_two_by_hand() -> None:
    # From x to 0.5 -+ d with half of the mass each: transport d^2. The pair to itself: with the two points
    # 2 d apart and eps, OT_eps(t, t) is -eps log((1 + exp(-4 d^2 / eps)) / 2).
    d, blur = 0.04, 0.05
    itself = -(blur**2) * np.log((1 + np.exp(-4 * d**2 / blur**2)) / 2)
    pair = [[0.5 - d, 0.5], [0.5 + d, 0.5]]
    distance = metrics.sinkhorn_distance(ONE, [1.0], pair, [2.0, 2.0], blur=blur)
    assert distance**2 == pytest.approx(d**2 - itself / 2, rel=1e-4)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_shift_is_as_long_as_it_is(dim: int) -> None:
    x = np.random.default_rng(2).uniform(0.2, 0.5, (300, dim))
    shift = np.array([0.3, -0.1, 0.2])[:dim]
    mass = np.ones(300)
    distances = metrics.sinkhorn_distance([x, x + shift], mass, [x, x], mass)
    np.testing.assert_allclose(distances, [0, np.linalg.norm(shift)], atol=1e-4)


def test_masses_count_by_their_share() -> None:
    x = np.random.default_rng(3).uniform(0.2, 0.5, (50, 2))
    twice = np.concatenate([x, x])
    assert metrics.sinkhorn_distance(twice, np.ones(100), x, np.full(50, 8.0)) == pytest.approx(0, abs=1e-3)


def test_many_particles_are_merged_first(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    x, y = rng.uniform(0.2, 0.5, (1500, 2)), rng.uniform((0.2, 0.3), (0.6, 0.5), (1200, 2))
    merged = metrics.sinkhorn_distance(x, np.ones(1500), y, np.ones(1200))
    monkeypatch.setattr(transport, "MAX_POINTS", 2000)
    assert merged == pytest.approx(metrics.sinkhorn_distance(x, np.ones(1500), y, np.ones(1200)), rel=0.01)


def test_one_that_does_not_converge_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "_ITERATIONS", 2)
    x = np.random.default_rng(5).uniform(0.2, 0.8, (100, 2))
    with pytest.raises(SimulationError, match="take a larger blur than"):
        metrics.sinkhorn_distance(x, np.ones(100), x**2, np.ones(100), blur=0.02)


def test_what_it_needs_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ot", None)
    with pytest.raises(ConfigError, match=r"pip install 'hybridmpm\[metrics\]'"):
        metrics.sinkhorn_distance(ONE, [1.0], ONE, [1.0])


def test_bad_arguments() -> None:
    with pytest.raises(ConfigError, match=r"blur must be in \[0.01, 1\] m, got 0"):
        metrics.sinkhorn_distance(ONE, [1.0], ONE, [1.0], blur=0.0)
    with pytest.raises(ConfigError, match="as many frames and axes"):
        metrics.sinkhorn_distance(ONE, [1.0], [ONE], [1.0])

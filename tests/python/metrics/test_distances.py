"""Distances of transport: exact, by Sinkhorn's algorithm and sliced, against closed forms."""

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
def test_a_shift_is_as_far_as_it_is_long_by_sinkhorn(dim: int) -> None:
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


@pytest.mark.parametrize("dim", [2, 3])
def test_an_exact_distance_of_a_shift_is_its_length(dim: int) -> None:
    x = np.random.default_rng(2).uniform(0.2, 0.5, (1000, dim))
    shift = np.array([0.3, -0.1, 0.2])[:dim]
    mass = np.ones(1000)
    assert metrics.transport_distance(x + shift, mass, x, mass) == pytest.approx(
        np.linalg.norm(shift), rel=1e-6
    )
    assert metrics.transport_distance(x, mass, x, mass) == pytest.approx(0, abs=1e-9)


def test_the_cheaper_of_two_assignments_counts_whatever_the_order() -> None:
    one, two = np.array([[0.1, 0.5], [0.9, 0.5]]), np.array([[0.8, 0.5], [0.3, 0.5]])
    expected = np.sqrt((0.2**2 + 0.1**2) / 2)
    assert metrics.transport_distance(one, [1.0, 1.0], two, [2.0, 2.0]) == pytest.approx(expected)


def test_masses_are_split_where_they_must_be() -> None:
    # Three quarters of the mass stay, one quarter goes 0.4 m.
    one, two = np.array([[0.1, 0.5]]), np.array([[0.1, 0.5], [0.5, 0.5]])
    assert metrics.transport_distance(one, [4.0], two, [3.0, 1.0]) == pytest.approx(0.2)


def test_stretching_along_a_line_is_by_the_sorted_order() -> None:
    x = np.column_stack([np.linspace(0.3, 0.5, 900), np.full(900, 0.5)])
    wide = np.column_stack([np.linspace(0.2, 0.6, 900), np.full(900, 0.5)])
    expected = np.sqrt(np.mean((x - wide) ** 2 @ [1, 1]))
    assert metrics.transport_distance(x, np.ones(900), wide, np.ones(900)) == pytest.approx(
        expected, rel=0.01
    )


def test_what_has_no_exact_distance_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    x, mass = np.full((4, 2), 0.5), np.ones(4)
    with pytest.raises(ConfigError, match=r"predicted must be one state \(N, D\), got shape \(1, 4, 2\)"):
        metrics.transport_distance(x[None], mass, x, mass)
    with pytest.raises(ConfigError, match="as many axes, got 2 and 3"):
        metrics.transport_distance(x, mass, np.full((4, 3), 0.5), mass)
    with pytest.raises(ConfigError, match=r"clusters must be in \[1, 2000\], got 0"):
        metrics.transport_distance(x, mass, x, mass, clusters=0)
    monkeypatch.setitem(sys.modules, "ot", None)
    with pytest.raises(ConfigError, match=r"needs POT: pip install 'hybridmpm\[metrics\]'"):
        metrics.transport_distance(x, mass, x, mass)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_sliced_distance_of_a_shift_is_its_length(dim: int) -> None:
    rng = np.random.default_rng(3)
    x, mass = rng.uniform(0.2, 0.5, (300, dim)), rng.uniform(1, 2, 300)
    assert metrics.sliced_distance(x, mass, x, mass) == 0
    shift = np.array([0.03, -0.04, 0.0])[:dim]
    # In 3D the twelve directions leave 10 %.
    expected = pytest.approx(0.05, rel=1e-6 if dim == 2 else 0.1)
    assert float(metrics.sliced_distance(x + shift, mass, x, mass)) == expected
    both = metrics.sliced_distance(np.stack([x, x + shift]), mass, np.stack([x, x]), mass)
    assert both.shape == (2,)
    assert both[0] == 0


def test_mass_counts_and_not_the_number_of_particles() -> None:
    x = np.array([[0.2, 0.5], [0.4, 0.5], [0.4, 0.5]])
    heavy = metrics.sliced_distance(x[:2], [1.0, 2.0], x, [1.0, 1.0, 1.0])
    light = metrics.sliced_distance(x[:2], [1.0, 1.0], x, [1.0, 1.0, 1.0])
    assert heavy < 0.3 * light


def test_the_order_of_particles_does_not_count() -> None:
    rng = np.random.default_rng(4)
    x, y, mass = rng.uniform(0, 1, (200, 2)), rng.uniform(0, 1, (200, 2)), rng.uniform(1, 2, 200)
    order = rng.permutation(200)
    one, two = (
        metrics.sliced_distance(x, mass, y, mass),
        metrics.sliced_distance(x[order], mass[order], y, mass),
    )
    assert float(one) == pytest.approx(float(two), rel=1e-9)


def test_what_has_no_sliced_distance_is_refused() -> None:
    x, mass = np.full((4, 2), 0.5), np.ones(4)
    with pytest.raises(ConfigError, match="as many frames and axes"):
        metrics.sliced_distance(x, mass, np.full((4, 3), 0.5), mass)
    with pytest.raises(ConfigError, match="predicted"):
        metrics.sliced_distance(x, mass[:3], x, mass)


def test_percentiles_of_the_density() -> None:
    rng = np.random.default_rng(5)
    x, mass = rng.uniform(0.3, 0.6, (400, 2)), np.ones(400)
    low, high = metrics.density_extremes(x, mass, 32)
    assert metrics.density_percentile(x, mass, 32, 0) == low
    assert metrics.density_percentile(x, mass, 32, 100) == high
    assert low < metrics.density_percentile(x, mass, 32) < high
    assert metrics.density_percentile(np.stack([x, x]), mass, 32).shape == (2,)
    with pytest.raises(ConfigError, match=r"percentile must be in \[0, 100\], got 101"):
        metrics.density_percentile(x, mass, 32, 101)

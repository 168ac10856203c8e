"""The sliced distance of transport, and percentiles of the density."""

import numpy as np
import pytest

from hybridmpm import ConfigError, metrics


@pytest.mark.parametrize("dim", [2, 3])
def test_a_shift_is_as_far_as_it_is_long(dim: int) -> None:
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


def test_what_cannot_be_compared_is_refused() -> None:
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

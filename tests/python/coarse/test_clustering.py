"""Clusters are balanced, compact and the same for the same seed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybridmpm import ConfigError
from hybridmpm.coarse import merging
from hybridmpm.coarse.merging import balanced_clusters


def squared_radius(x: np.ndarray, labels: np.ndarray) -> float:
    """Return the mean squared distance of points to the centre of their cluster."""
    sizes = np.bincount(labels)[:, None]
    centers = np.stack([np.bincount(labels, axis) for axis in x.T], axis=1) / sizes
    return float(((x - centers[labels]) ** 2).sum(axis=1).mean())


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 200), st.floats(0, 1), st.sampled_from([2, 3]), st.integers(0, 9), st.sampled_from([1, 4])
)
def test_sizes_differ_by_at_most_one(n: int, share: float, dim: int, seed: int, places: int) -> None:
    count = max(1, round(share * n))
    # Rounded, so that many points coincide.
    x = np.round(np.random.default_rng(seed).random((n, dim)), places)
    labels = balanced_clusters(x, count, seed=seed)
    sizes = np.bincount(labels, minlength=count)
    assert len(sizes) == count
    assert (sizes.min(), sizes.max()) == (n // count, -(-n // count))


def test_four_clumps_are_four_clusters() -> None:
    corners = np.array([[0.1, 0.1], [0.9, 0.2], [0.2, 0.8], [0.8, 0.9]])
    x = np.repeat(corners, 5, axis=0) + np.random.default_rng(0).uniform(-0.05, 0.05, (20, 2))
    labels = balanced_clusters(x, 4)
    assert sorted(map(tuple, labels.reshape(4, 5).tolist())) == [(k,) * 5 for k in range(4)]


def test_exchanges_never_spread_the_clusters(monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.random.default_rng(1).random((800, 2))
    radii = []
    for rounds in range(0, 13, 3):
        monkeypatch.setattr(merging, "_ROUNDS", rounds)
        radii.append(squared_radius(x, balanced_clusters(x, 100)))
    assert radii == sorted(radii, reverse=True)
    # A disc of the area of each cluster would have 1 / (2 pi 100).
    assert 1 / (200 * np.pi) < radii[-1] < 1.4 / (200 * np.pi)


def test_the_seed_decides() -> None:
    x = np.random.default_rng(2).random((300, 3))
    one = balanced_clusters(x, 40, seed=5)
    np.testing.assert_array_equal(one, balanced_clusters(x, 40, seed=5))
    assert (one != balanced_clusters(x, 40, seed=6)).any()


@pytest.mark.parametrize("count", [0, 6, 2.5])
def test_bad_counts(count: int) -> None:
    with pytest.raises(ConfigError, match=r"count must be .*\[1, 5\]"):
        balanced_clusters(np.zeros((5, 2)), count)

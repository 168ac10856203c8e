"""Statistics in one pass, against numpy on everything at once and against numbers worked out by hand."""

from pathlib import Path

import numpy as np
import pytest

from hybridmpm import DataError, data
from hybridmpm.data import metadata
from hybridmpm.data.statistics import Moments

from .conftest import trajectories


def test_by_hand() -> None:
    # One particle goes 0, 1, 3 and 1, 1, 0; the other is kinematic.
    positions = np.array([[[0, 1], [9, 9]], [[1, 1], [9, 9]], [[3, 0], [9, 9]]], dtype=np.float32)
    total = data.statistics([data.Trajectory(positions=positions, types=np.array([5, 3]))])
    assert total.metadata() == {
        "vel_mean": [1.5, -0.5],
        "vel_std": [0.5, 0.5],
        "acc_mean": [1.0, -1.0],
        "acc_std": [0.0, 0.0],
    }
    assert (total.particles, total.states, total.types) == ([2], [3], {3: 1, 5: 1})


def test_parts_give_what_the_whole_gives() -> None:
    rng = np.random.default_rng(0)
    # A mean far from zero, where sums of squares would lose the spread.
    vectors = 1e4 + rng.normal(size=(5000, 3)) * (1.0, 0.1, 10.0)
    parts = Moments()
    for part in np.split(vectors, [1, 1, 700, 4000]):
        parts.add(part)
    assert parts.count == 5000
    np.testing.assert_allclose(parts.mean, vectors.mean(axis=0), rtol=1e-13)
    np.testing.assert_allclose(parts.std, vectors.std(axis=0), rtol=1e-9)


def test_metadata_hold_those_of_the_training_split(made: Path) -> None:
    moving = [one.positions[:, one.types != 3].astype(np.float64) for one in trajectories(made)]
    velocity = np.concatenate([np.diff(x, axis=0).reshape(-1, 2) for x in moving])
    acceleration = np.concatenate([np.diff(x, 2, axis=0).reshape(-1, 2) for x in moving])
    about = metadata.read(made)
    np.testing.assert_allclose(about["vel_mean"], velocity.mean(axis=0), rtol=1e-10)
    np.testing.assert_allclose(about["vel_std"], velocity.std(axis=0), rtol=1e-10)
    np.testing.assert_allclose(about["acc_mean"], acceleration.mean(axis=0), rtol=1e-10)
    np.testing.assert_allclose(about["acc_std"], acceleration.std(axis=0), rtol=1e-10)


def test_dimensions_do_not_mix() -> None:
    flat = data.Trajectory(positions=np.zeros((3, 1, 2), np.float32), types=np.array([5]))
    solid = data.Trajectory(positions=np.zeros((3, 1, 3), np.float32), types=np.array([5]))
    with pytest.raises(DataError, match="has dimension 3, those before it 2"):
        data.statistics([flat, solid])


def test_nothing_moves() -> None:
    still = data.Trajectory(positions=np.zeros((3, 1, 2), np.float32), types=np.array([3]))
    assert data.statistics([still]).metadata()["vel_std"] == []

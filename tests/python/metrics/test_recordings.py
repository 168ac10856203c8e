"""Comparing recordings, and the floors and the ceiling to read errors by."""

import numpy as np
import pytest

from hybridmpm import ConfigError, MpmSolver, Scene, metrics, scenarios
from hybridmpm.recording import Recording, record


@pytest.fixture(scope="module")
def truth() -> Recording:
    """Return water and sand in mid-splash, every 20th frame of 100."""
    return record(MpmSolver(scenarios.water_sand_2d(1_100_000)), 100, every=20)


def test_against_itself_there_is_no_error(truth: Recording) -> None:
    errors = metrics.compare(truth, truth)
    assert errors.pop("max_density").tolist() == [1.0] * 6
    assert {name: values.tolist() for name, values in errors.items()} == dict.fromkeys(errors, [0.0] * 6)


def test_each_is_the_measure_of_its_name(truth: Recording) -> None:
    still = metrics.held_still(truth)
    errors = metrics.compare(still, truth)
    x, mass, scene = truth.positions, truth.mass, truth.scene
    grids = [metrics.grid_mass(states[3], mass, scene.resolution) for states in (still.positions, x)]
    assert errors["grid_rmse"][3] == metrics.grid_rmse(*grids)
    assert errors["grid_nrmse"][3] == metrics.grid_nrmse(*grids)
    assert errors["grid_node_error"][3] == metrics.grid_node_error(*grids)
    kinetic = metrics.kinetic_energy(truth.velocities, mass)
    np.testing.assert_allclose(errors["kinetic_energy"], kinetic / kinetic.max())
    height = (mass[:, None] * (x[..., 1] - 0.1).T).sum(axis=0, dtype=np.float64) * 9.81
    mechanical = kinetic + height
    expected = np.abs(height[0] - mechanical) / mechanical.max()
    np.testing.assert_allclose(errors["mechanical_energy"], expected, rtol=1e-4)
    np.testing.assert_array_equal(errors["centroid"], metrics.centroid_error(x[[0] * 6], mass, x, mass))
    assert errors["penetrations"].tolist() == [0.0] * 6


def test_the_ceiling_is_far_above_the_floors(truth: Recording) -> None:
    scene = truth.scene
    other = record(MpmSolver(metrics.other_jitter(scene)), 100, every=20)
    assert not np.array_equal(other.positions[0], truth.positions[0])
    floor = metrics.compare(other, truth)["grid_rmse"]
    merged = metrics.compare(metrics.merged_states(truth, 0.25), truth)["grid_rmse"]
    ceiling = metrics.compare(metrics.held_still(truth), truth)["grid_rmse"]
    assert (floor[1:] < 0.5 * ceiling[1:]).all()
    assert (merged[1:] < 0.2 * ceiling[1:]).all()
    assert (floor[1:] > 0).all()


def test_other_jitter_moves_nothing_else() -> None:
    scene = scenarios.sand_2d(3)
    other = metrics.other_jitter(scene)
    one, two = scene.sample(), other.sample()
    assert np.abs(one.x - two.x).max() <= 0.5001 * scene.spacing
    assert (one.v == two.v).all()
    assert metrics.other_jitter(other, -1) == scene


def test_merged_states_keep_types_masses_and_centroid(truth: Recording) -> None:
    merged = metrics.merged_states(truth, 1 / 8)
    assert merged.positions.shape[1] == round(len(truth.mass) / 8)
    for kind in (5, 6):
        mine, theirs = (one.mass[one.types == kind].sum(dtype=np.float64) for one in (merged, truth))
        assert mine == pytest.approx(theirs, rel=1e-6)
    centroid = metrics.centroid_error(merged.positions, merged.mass, truth.positions, truth.mass)
    assert centroid.max() < 1e-6


def test_other_frames_are_refused(truth: Recording, drop: Scene) -> None:
    with pytest.raises(ConfigError, match="the same frames"):
        metrics.compare(record(MpmSolver(drop), 3), truth)

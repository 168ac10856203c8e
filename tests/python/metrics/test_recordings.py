"""Comparing recordings, the floors and the ceiling to read errors by, and tables of errors."""

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


def filled() -> metrics.ErrorTable:
    table = metrics.ErrorTable()
    for seed, (good, bad) in enumerate([(1.0, 2.0), (3.0, 5.0), (5.0, 8.0)]):
        table.add("good", f"scene {seed}", {"error": good, "other": 10 * good})
        table.add("bad", f"scene {seed}", {"error": bad})
    table.add("bad", "scene 9", {"error": 9.0})
    return table


def test_mean_and_standard_error() -> None:
    # 1, 3, 5: standard deviation 2, over sqrt(3)
    estimate = filled().estimate("good", "error")
    assert (estimate.mean, estimate.count) == (3.0, 3)
    assert estimate.standard_error == pytest.approx(2 / 3**0.5)
    assert str(estimate) == "3 ± 1.2"


def test_one_sample_has_no_standard_error() -> None:
    assert metrics.Estimate.of([4.0]).standard_error is None
    assert str(metrics.Estimate.of([4.0])) == "4"


def test_differences_are_paired_by_scene() -> None:
    # 1, 2, 3 in the scenes shared: the standard error is 1 / sqrt(3), smaller than that of either alone.
    difference = filled().difference("bad", "good", "error")
    assert (difference.mean, difference.count) == (2.0, 3)
    assert difference.standard_error == pytest.approx(1 / 3**0.5)


def test_rows_are_flat() -> None:
    good, bad = filled().rows(reference="good")
    assert good["method"] == "good"
    assert (good["error"], good["error_n"], good["error_difference"]) == (3.0, 3, None)
    assert good["other"] == 30.0
    assert (bad["error"], bad["error_n"], bad["error_difference"]) == (6.0, 4, 2.0)
    assert bad["error_difference_se"] == pytest.approx(1 / 3**0.5)
    assert "error_difference" not in filled().rows()[0]


def test_text() -> None:
    lines = filled().text().splitlines()
    assert [line.split("  ")[0].strip() or line.split()[0] for line in lines] == ["method", "good", "bad"]
    assert lines[1].split() == ["good", "3", "±", "1.2", "30", "±", "12"]
    assert lines[2].split()[-1] == "-"
    assert len({len(line) for line in lines}) == 1


def test_refusals() -> None:
    table = filled()
    with pytest.raises(ConfigError, match="already"):
        table.add("good", "scene 0", {"error": 1.0})
    with pytest.raises(ConfigError, match="must be finite"):
        table.add("good", "scene 7", {"error": float("nan")})
    with pytest.raises(ConfigError, match="no other of bad"):
        table.estimate("bad", "other")
    table.add("third", "elsewhere", {"error": 1.0})
    with pytest.raises(ConfigError, match="share no scene"):
        table.difference("third", "good", "error")
    with pytest.raises(ConfigError, match="one or more finite numbers"):
        metrics.Estimate.of([])

"""What is measured of control, on cases whose answer is known."""

import numpy as np
import pytest

from hybridmpm import Box, MpmSolver, Scene
from hybridmpm.control import Arrow, Ellipse, prepare
from hybridmpm_lab.control.entrants import entrant
from hybridmpm_lab.control.measures.end_state import EndStates, distance_from_path
from hybridmpm_lab.control.measures.forces import fine_share, least_force, measure_forces
from hybridmpm_lab.control.measures.naturalness import FEATURES, auc, features, real_against_real
from hybridmpm_lab.control.report.aims import ratio_of_means
from hybridmpm_lab.control.suite.cases import Case
from hybridmpm_lab.control.suite.problems import Problem
from hybridmpm_lab.control.trial import run

pytestmark = pytest.mark.needs("ot", "metrics")

OVAL = Ellipse(np.array([0.5, 0.6]), np.array([0.12, 0.1]), 0.3)


@pytest.fixture(scope="module")
def block() -> MpmSolver:
    """Return a block of water in free fall, which has just begun to move."""
    body = Box(lower=(0.3, 0.3), upper=(0.5, 0.45), material="water", velocity=(0.5, 0.2))
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[body]))
    solver.advance(1)
    return solver


def test_a_filled_sketch_has_all_of_its_mass_inside_and_nowhere_to_go(block: MpmSolver) -> None:
    ready = Problem(Case("free", "water_2d", "oval", 0), block, OVAL, OVAL, 80, None, None)
    row = run(ready, entrant("filled")).row
    assert (row["inside"], row["inside_later"]) == (1.0, 1.0)
    assert row["transport"] == pytest.approx(0, abs=1e-6)
    assert row["centroid_error"] == pytest.approx(0, abs=1e-6)
    assert row["error"] is None
    assert row["rms_g"] is None


def test_the_truth_has_no_error_and_a_shift_of_it_is_that_far_off(block: MpmSolver) -> None:
    goal = prepare(block, OVAL, method="none", frames=80).goal
    truth = block.positions
    states = EndStates(block.scene, block.mass, goal, truth)
    exact = states.measure(truth, None)
    assert exact["error"] == exact["nrmse"] == exact["node_error"] == 0
    assert exact["transport"] == pytest.approx(0, abs=1e-6)
    assert exact["density_ratio"] == 1
    off = states.measure(truth + np.float32([0.03, 0.04]), None)
    assert off["transport"] == pytest.approx(0.05, rel=1e-4)


def test_the_centre_of_mass_is_held_against_the_sketch(block: MpmSolver) -> None:
    goal = prepare(block, Arrow(np.array([[0.4, 0.4], [0.5, 0.4]])), method="none", frames=80).goal
    states = EndStates(block.scene, block.mass, goal, None)
    found = states.measure(block.positions + np.float32([0.1, 0.1]), None)
    assert found["centroid_error"] == pytest.approx(0.1, rel=1e-4)
    assert found["direction_error"] == pytest.approx(45, rel=1e-4)
    assert found["inside"] is None


def test_the_distance_from_a_path_is_that_of_its_nearest_points() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    points = np.array([[0.5, 0.2], [1.1, 0.5], [1.3, 1.4]])
    assert distance_from_path(points, path) == pytest.approx((0.2 + 0.1 + 0.5) / 3)


def test_a_constant_force_is_coarse_and_one_that_alternates_is_fine() -> None:
    side = np.linspace(0.3, 0.6, 60, dtype=np.float32)
    x = np.stack(np.meshgrid(side, side), axis=-1).reshape(1, -1, 2)
    weight = np.full(3600, 1 / 3600)
    assert fine_share(x, [np.float32([3.0, 4.0])], weight) == 0
    signs = np.float32([[(-1.0) ** (i + j), 0.0] for i in range(60) for j in range(60)])
    assert fine_share(x, [signs], weight) == pytest.approx(1, abs=1e-3)
    smooth = np.float32(np.sin(2 * np.pi * x[0, :, :1]) * [1.0, 0.0])
    assert fine_share(x, [smooth], weight) < 0.05
    assert fine_share(x, [np.zeros(2, np.float32)], weight) is None
    row = measure_forces(x, [np.float32([3.0, 4.0])], weight)
    assert row["rms_g"] == row["peak_g"] == pytest.approx(5 / 9.81)


def test_the_least_force_of_a_body_carried_straight_is_that_of_the_formula(block: MpmSolver) -> None:
    goal = prepare(block, Arrow(np.array([[0.4, 0.4], [0.55, 0.5]])), method="none", frames=80).goal
    d, u, g, t = np.array([0.15, 0.1]), goal.cloud.mean_velocity, np.array([0.0, -9.81]), 0.2
    first, last = 6 * d / t**2 - 4 * u / t - g, -6 * d / t**2 + 2 * u / t - g
    bound = least_force(goal, 80)
    square = (first @ first + first @ last + last @ last) / 3
    assert bound["bound_g"] == pytest.approx(np.sqrt(square) / 9.81, rel=1e-6)
    assert bound["bound_peak_g"] == pytest.approx(np.linalg.norm(first) / 9.81, rel=1e-6)


def test_features_of_two_turning_blocks_are_those_of_the_formula() -> None:
    side = (np.arange(30) + 0.5) / 256
    x = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    both = np.concatenate([x + 0.2, x + 0.6])
    centre = np.repeat([[0.2], [0.6]], 900, axis=0) + side.mean()
    turning = 3.0 * (both - centre)[:, ::-1] * [-1, 1]
    found = dict(zip(FEATURES, features(both, turning, spacing=1 / 256, resolution=128), strict=True))
    assert found["pieces"] == pytest.approx(np.log(2))
    assert found["fill_50"] == pytest.approx(1, abs=0.01)
    assert found["curl_50"] == pytest.approx(np.log(np.sqrt(2) * 3 + 0.1), abs=0.01)
    assert found["divergence_95"] == pytest.approx(np.log(0.1), abs=0.01)
    assert 0.1 < found["surface"] < 0.4


def test_the_classifier_tells_apart_what_differs_and_nothing_else() -> None:
    rng = np.random.default_rng(0)

    def seeds(shift: float) -> list[np.ndarray]:
        # Frames of a seed resemble each other.
        return [rng.normal(shift, 1, 13) + rng.normal(0, 0.3, (4, 13)) for _ in range(100)]

    real = seeds(0.0)
    assert real_against_real(real) == pytest.approx(0.5, abs=0.05)
    assert auc(seeds(1.0)[:50], real) > 0.95
    assert auc(real[:50], real[50:]) == pytest.approx(0.5, abs=0.15)


def test_a_ratio_of_means_has_no_error_where_all_pairs_have_that_ratio() -> None:
    constant = np.array([1.0, 1.2, 0.8])
    assert ratio_of_means(0.6 * constant, constant) == (pytest.approx(0.6), pytest.approx(0))
    ratio, error = ratio_of_means(np.array([0.5, 0.7]), np.array([1.0, 1.0]))
    assert (ratio, error) == (pytest.approx(0.6), pytest.approx(0.1))

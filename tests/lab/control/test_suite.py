"""The suite of control: valid cases that never change, and measures of runs whose result is known."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hybridmpm import Box, MpmSolver, Scene, scenarios
from hybridmpm.control import Arrow, Ellipse, Keyframe, Shape, prepare
from hybridmpm.control.goal.room import Room
from hybridmpm_lab.control.measures import (
    FEATURES,
    distance_from_path,
    end_figures,
    features,
    force_figures,
    recognised,
)
from hybridmpm_lab.control.outlines import OUTLINES
from hybridmpm_lab.control.runner import Problem, problem, run
from hybridmpm_lab.control.suite import Case, cases, digest

pytestmark = pytest.mark.needs("ot", "metrics")

IN_TURN = cases(["shape", "sequence"])
DRAWN = [case for case in cases() if case.family != "reversed" and case not in IN_TURN]
OVAL = Ellipse(np.array([0.5, 0.6]), np.array([0.12, 0.1]), 0.3)


@pytest.fixture(scope="module")
def block() -> MpmSolver:
    """Return a block of water in free fall, after one frame."""
    body = Box(lower=(0.3, 0.3), upper=(0.5, 0.45), material="water", velocity=(0.5, 0.2))
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[body]))
    solver.advance(1)
    return solver


def test_the_suite_has_790_sketches_of_seeds_of_tests() -> None:
    every = cases()
    assert len(set(every)) == len(every) == 790
    assert min(case.seed for case in every) > 1_100_000
    counts = {family: len(cases([family])) for family in dict.fromkeys(case.family for case in every)}
    drawn = {"free": 70, "bent": 50, "obstacles": 70, "gather": 50, "hand": 30, "shape": 80, "sequence": 40}
    assert counts == {"reversed": 400, **drawn}
    assert len(cases(["reversed"], ["sand_3d"], seeds=3)) == 6


def test_the_digest_is_that_of_the_published_suite() -> None:
    assert digest() == "c908368cd5443b6c"


def test_every_start_fits_its_scenario_and_its_sketch_the_room() -> None:
    for case in DRAWN:
        start = case.start()
        info = scenarios.describe(case.scenario)
        volume = sum(body.measure for body in start.scene.bodies)
        assert start.scene.dim == info.dim
        assert 1000 < volume / start.scene.spacing**info.dim < 1.02 * info.max_particles
        points = start.sketch.outline(64) if isinstance(start.sketch, Ellipse) else start.sketch.points
        middle = start.sketch.center if isinstance(start.sketch, Ellipse) else points.mean(axis=0)
        assert (np.abs(points - 0.5) < 0.45).all()
        inside = np.append(middle, [0.5] * (info.dim - 2))[None]
        assert Room(start.scene, 0.0).is_free(inside).all(), case
        assert bool(start.scene.obstacles) == (case.family == "obstacles" or "ramps" in case.scenario)


def test_shapes_lie_within_the_walls_and_have_about_the_area_of_the_fluid() -> None:
    for case in IN_TURN:
        start = case.start()
        volume = sum(body.measure for body in start.scene.bodies)
        several = start.sketch if isinstance(start.sketch, tuple) else [Keyframe(start.sketch)]
        assert len(several) == (3 if case.family == "sequence" else 1)
        for keyframe in several:
            if isinstance(keyframe.goal, Shape):
                assert not keyframe.goal.crosses_itself, case
                assert (np.abs(np.array(keyframe.goal.bounds) - 0.5) < 0.37).all(), case
                size = keyframe.goal.area * (1.0 if start.scene.dim == 2 else 0.07) / volume
                assert 0.94 < size < 1.11, case
    assert len({case.seed for case in cases(["shape"])}) == len(OUTLINES) == 20


@pytest.mark.long
def test_networks_hand_shapes_over() -> None:
    ready = problem(Case("sequence", "water_2d", "sequence", 1_255_000))
    assert run(ready, "learned", None)[0]["handed_over"] > 0.6


def test_three_goals_in_turn_are_measured_where_each_is_passed() -> None:
    ready = problem(Case("sequence", "water_2d", "sequence", 1_255_000))
    floor, row = (run(ready, name, None)[0] for name in ("filled", "analytic"))
    assert (floor["inside"], floor["transport"]) == (1.0, 0.0)
    assert row["inside"] > 0.95
    assert row["handed_over"] == 0.0
    assert row["transport"] < 0.01


def test_the_reading_of_a_hand_is_near_to_the_sketch_before_it() -> None:
    for case in cases(["hand"]):
        start = case.start()
        assert start.meant is not None
        assert start.sketch.kind == start.meant.kind
        if isinstance(start.meant, Ellipse):
            assert isinstance(start.sketch, Ellipse)
            np.testing.assert_allclose(start.sketch.center, start.meant.center, atol=0.015)
        else:
            assert isinstance(start.sketch, Arrow)
            ends = start.sketch.points[[0, -1]]
            np.testing.assert_allclose(ends, start.meant.points[[0, -1]], atol=0.04)


def test_a_hand_is_judged_by_the_sketch_before_it() -> None:
    ready = problem(Case("hand", "water_2d", "oval", 1_245_000))
    assert ready.meant is not ready.sketch
    # The floor is the error of the reading alone.
    assert 0 < run(ready, "filled", None)[0]["transport"] < 0.03
    meant = dataclasses.replace(ready, sketch=ready.meant)
    assert run(meant, "filled", None)[0]["transport"] < 1e-6


def test_a_case_is_the_same_to_the_bit_each_time() -> None:
    case = Case("gather", "sand_3d", "oval", 1_240_001)
    one, two = problem(case), problem(case)
    np.testing.assert_array_equal(one.simulator.positions, two.simulator.positions)
    assert (one.simulator.frame, one.truth, one.frames) == (5, None, None)


def test_the_oracle_leads_a_reversed_case_back_to_its_truth() -> None:
    ready = problem(cases(["reversed"], ["water_2d"], seeds=1)[0])
    assert ready.truth is not None
    assert ready.frames == 100
    moved = np.linalg.norm(ready.simulator.positions.mean(axis=0) - ready.truth.mean(axis=0))
    assert moved > 0.05
    row = run(ready, "oracle", None)[0]
    assert row["error"] < 0.3
    assert row["transport"] < 0.01


@pytest.mark.long
def test_every_sketch_can_be_followed_from_its_start() -> None:
    for case in DRAWN:
        ready = problem(case)
        needs = prepare(ready.simulator, ready.sketch, method="none").needs()
        assert not [one for one in needs.obstructions if one.reason in {"wall", "obstacle"}], case
        assert needs.acceleration < 7, case


def test_a_filled_sketch_has_all_of_its_mass_inside_and_no_distance(block: MpmSolver) -> None:
    row = run(Problem(Case("free", "water_2d", "oval", 0), block, OVAL, OVAL), "filled", None)[0]
    assert (row["inside"], row["inside_later"]) == (1.0, 1.0)
    assert row["transport"] == pytest.approx(0, abs=1e-6)
    assert row["centroid_error"] == pytest.approx(0, abs=1e-6)
    assert row["error"] is None
    assert row["rms_g"] is None


def test_the_truth_has_no_error_and_a_shift_of_it_its_length(block: MpmSolver) -> None:
    goal = prepare(block, OVAL, method="none", frames=80).goal
    truth = block.positions
    exact = end_figures(block, goal, truth, truth, None)
    assert exact["error"] == exact["nrmse"] == exact["node_error"] == 0
    assert exact["transport"] == pytest.approx(0, abs=1e-6)
    shifted = end_figures(block, goal, truth, truth + np.float32([0.03, 0.04]), None)
    assert shifted["transport"] == pytest.approx(0.05, rel=1e-4)


def test_the_centroid_error_is_the_distance_from_the_tip(block: MpmSolver) -> None:
    goal = prepare(block, Arrow(np.array([[0.4, 0.4], [0.5, 0.4]])), method="none", frames=80).goal
    found = end_figures(block, goal, None, block.positions + np.float32([0.1, 0.1]), None)
    assert found["centroid_error"] == pytest.approx(0.1, rel=1e-4)
    assert found["inside"] is None


def test_the_distance_from_a_path_is_that_of_its_nearest_points() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    points = np.array([[0.5, 0.2], [1.1, 0.5], [1.3, 1.4]])
    assert distance_from_path(points, path) == pytest.approx((0.2 + 0.1 + 0.5) / 3)


def test_forces_and_their_bound_are_those_of_the_formula(block: MpmSolver) -> None:
    goal = prepare(block, Arrow(np.array([[0.4, 0.4], [0.55, 0.5]])), method="none", frames=80).goal
    d, u, g, t = np.array([0.15, 0.1]), goal.cloud.mean_velocity, np.array([0.0, -9.81]), 0.2
    first, last = 6 * d / t**2 - 4 * u / t - g, -6 * d / t**2 + 2 * u / t - g
    bound = np.sqrt((first @ first + first @ last + last @ last) / 3) / 9.81
    found = force_figures(goal, [np.float32([3.0, 4.0])] * 80)
    assert found["rms_g"] == found["peak_g"] == pytest.approx(5 / 9.81)
    assert found["bound_g"] == pytest.approx(bound, rel=1e-6)
    assert found["rms_ratio"] == pytest.approx(5 / 9.81 / bound, rel=1e-6)


def test_features_of_two_turning_blocks_are_those_of_the_formula() -> None:
    side = (np.arange(30) + 0.5) / 256
    x = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    both = np.concatenate([x + 0.2, x + 0.6])
    centre = np.repeat([[0.2], [0.6]], 900, axis=0) + side.mean()
    turning = 3.0 * (both - centre)[:, ::-1] * [-1, 1]
    scene = SimpleNamespace(spacing=1 / 256, resolution=128, dim=2, cells=(128, 128))
    blocks: Any = SimpleNamespace(positions=both, velocities=turning, scene=scene)
    found = dict(zip(FEATURES, features(blocks), strict=True))
    assert found["pieces"] == pytest.approx(np.log(2))
    assert found["fill_50"] == pytest.approx(1, abs=0.01)
    assert found["curl_50"] == pytest.approx(np.log(np.sqrt(2) * 3 + 0.1), abs=0.01)
    assert found["divergence_95"] == pytest.approx(np.log(0.1), abs=0.01)
    assert 0.1 < found["surface"] < 0.4


def test_the_classifier_recognises_what_differs_from_the_truth_alone() -> None:
    rng = np.random.default_rng(0)

    def near(true: list[np.ndarray], shift: float) -> list[np.ndarray]:
        return [frames + rng.normal(shift, 0.3, frames.shape) for frames in true]

    # Frames of a seed resemble each other, and seeds differ more than a method from the truth.
    true = [rng.normal(0, 1, 13) + rng.normal(0, 0.3, (4, 13)) for _ in range(60)]
    assert recognised(near(true, 0.3), true) > 0.9
    assert recognised(near(true, 0.0), near(true, 0.0)) == pytest.approx(0.5, abs=0.1)
    assert recognised(true, true) == 0.5

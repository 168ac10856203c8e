"""The suite of control: every case is valid, and the same whenever it is drawn."""

import dataclasses

import numpy as np
import pytest

from hybridmpm import scenarios
from hybridmpm.control import Arrow, Ellipse, prepare
from hybridmpm.control.goal.room import Room
from hybridmpm_lab.control.entrants import entrant
from hybridmpm_lab.control.suite.cases import FAMILIES, KINDS, SCENARIOS, Case, cases, digest
from hybridmpm_lab.control.suite.problems import problem
from hybridmpm_lab.control.trial import run

FREE = [case for case in cases() if case.family != "reversed"]


def test_the_suite_has_the_sketches_that_the_documentation_promises() -> None:
    assert len(set(cases())) == len(cases()) == 4 * 2 * 50 + 10 * (7 + 5 + 7 + 5) + 30
    for family in FAMILIES:
        for scenario in SCENARIOS[family]:
            for kind in KINDS[family]:
                mine = [case for case in cases([family], [scenario]) if case.kind == kind]
                assert len(mine) == {"reversed": 50, "hand": 5}.get(family, 10)
                assert len(cases([family], [scenario], seeds=3)) == 3 * len(KINDS[family])


def test_its_seeds_are_those_of_tests_alone() -> None:
    assert min(case.seed for case in cases()) > 1_100_000


def test_the_digest_is_the_same_each_time_and_tells_versions_apart() -> None:
    before = digest()
    digest.cache_clear()
    assert digest() == before != digest(0)


def test_every_start_fits_its_scenario_and_its_sketch_the_room() -> None:
    for case in FREE:
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


def test_obstacles_lie_between_or_belong_to_the_scenario() -> None:
    for case in FREE:
        has_obstacles = bool(case.start().scene.obstacles)
        assert has_obstacles == (case.family == "obstacles" or "ramps" in case.scenario)


def test_what_is_read_from_a_hand_is_near_to_what_it_meant() -> None:
    found = [case.start() for case in cases(["hand"])]
    assert len({start.meant is start.sketch for start in found}) == 1
    for start in found:
        assert start.meant is not None
        assert start.sketch.kind == start.meant.kind
        if isinstance(start.meant, Ellipse):
            assert isinstance(start.sketch, Ellipse)
            np.testing.assert_allclose(start.sketch.center, start.meant.center, atol=0.015)
        else:
            assert isinstance(start.sketch, Arrow)
            ends = start.sketch.points[[0, -1]]
            np.testing.assert_allclose(ends, start.meant.points[[0, -1]], atol=0.04)


def test_a_hand_is_judged_by_what_it_meant() -> None:
    ready = problem(Case("hand", "water_2d", "oval", 1_245_000))
    trial = run(ready, entrant("filled"))
    assert ready.meant is not ready.sketch
    # The floor is what the reading alone is off.
    assert 0 < trial.row["transport"] < 0.03
    meant = dataclasses.replace(ready, sketch=ready.meant)
    assert run(meant, entrant("filled")).row["transport"] < 1e-6


def test_a_case_is_the_same_to_the_bit_each_time() -> None:
    case = Case("gather", "sand_3d", "oval", 1_240_001)
    one, two = problem(case), problem(case)
    np.testing.assert_array_equal(one.simulator.positions, two.simulator.positions)
    assert one.simulator.frame == 5
    assert one.truth is None


def test_a_reversed_case_knows_where_it_came_from() -> None:
    case = cases(["reversed"], ["water_2d"], seeds=1)[0]
    ready = problem(case)
    assert ready.truth is not None
    moved = np.linalg.norm(ready.simulator.positions.mean(axis=0) - ready.truth.mean(axis=0))
    assert moved > 0.05
    assert ready.frames == 100


@pytest.mark.long
def test_every_sketch_can_be_followed_from_its_start() -> None:
    for case in FREE:
        ready = problem(case)
        needs = prepare(ready.simulator, ready.sketch, method="none").needs()
        assert not [one for one in needs.obstructions if one.reason in {"wall", "obstacle"}], case
        assert needs.acceleration < 7, case

"""A simulator that follows a sketch: frame by frame, to be ended at any time, and what comes out."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    Box,
    ConfigError,
    DomainError,
    Elastic,
    MpmSolver,
    NeuralPhysics,
    Sand,
    Scene,
    SegmentObstacle,
)
from hybridmpm import control as controls
from hybridmpm.control import METHODS, Arrow, Ellipse, follow, prepare, push
from hybridmpm.control.trajectory import SketchResult

OVAL = Ellipse(np.array([0.6, 0.6]), np.array([0.1, 0.075]), 0.4)
ARROW = Arrow(np.array([[0.3, 0.3], [0.5, 0.5]]))


def _solver(dim: int = 2, material: Any = "water", **more: Any) -> MpmSolver:
    lower, upper = (0.2, 0.2, 0.4)[:dim], (0.35, 0.35, 0.55)[:dim]
    bodies = more.pop("bodies", [Box(lower=lower, upper=upper, material=material)])
    return MpmSolver(Scene(dim=dim, resolution=64 if dim == 2 else 32, bodies=bodies, **more))


def test_each_step_is_one_frame_and_the_simulator_moves_with_it() -> None:
    solver = _solver()
    following = follow(solver, OVAL, frames=40)
    assert solver.frame == 0
    first = next(following)
    assert (first.frame, solver.frame, following.frames_done) == (1, 1, 1)
    assert np.array_equal(first.positions, solver.positions)
    rest = list(following)
    assert [frame.frame for frame in rest] == list(range(2, 41))
    result = following.result
    assert (result.ending, result.frames, result.first_frame) == ("done", 40, 0)
    assert np.array_equal(result.positions[1], first.positions)
    assert np.array_equal(result.force[0], first.force)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sketch", [OVAL, ARROW], ids=["oval", "arrow"])
def test_the_recorded_forces_give_the_same_bits(method: str, sketch: controls.Sketch) -> None:
    solver = _solver()
    solver.advance(3)
    twin = solver.copy()
    result = follow(solver, sketch, method, frames=30, hold=5).run()
    assert result.frames == 35
    path = twin.rollout(35, result.force)
    assert np.array_equal(path, result.positions)
    np.testing.assert_allclose(result.centroids[-1] - result.centroids[0], result.displacement)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    "material",
    ["water", "sand", Elastic(youngs_modulus=5e4, poisson_ratio=0.3)],
    ids=["water", "sand", "elastic"],
)
def test_an_arrow_is_followed_to_its_tip(dim: int, material: Any) -> None:
    result = follow(_solver(dim, material), ARROW).run()
    assert result.reached.miss < 3e-3
    assert result.reached.peak < 15.01


@pytest.mark.parametrize("dim", [2, 3])
def test_an_oval_is_filled_with_little_more_than_the_least_force(dim: int) -> None:
    following = follow(_solver(dim), OVAL)
    reached = following.run().reached
    assert reached.inside is not None
    assert reached.inside > (0.98 if dim == 2 else 0.9)
    assert reached.rms < 1.1 * following.guidance.needs().rms


def test_water_and_sand_follow_together() -> None:
    bodies = [
        Box(lower=(0.2, 0.2), upper=(0.3, 0.35), material="water"),
        Box(lower=(0.32, 0.2), upper=(0.4, 0.35), material=Sand()),
    ]
    reached = follow(_solver(bodies=bodies), OVAL).run().reached
    assert reached.inside is not None
    assert reached.inside > 0.95


def test_the_guidance_leads_where_the_constant_force_smears() -> None:
    bodies = [
        Box(lower=(0.1, 0.1), upper=(0.3, 0.2), material="water"),
        Box(lower=(0.7, 0.1), upper=(0.9, 0.2), material="water"),
    ]
    shares = {}
    for method in ("none", "constant", "analytic"):
        solver = _solver(bodies=bodies)
        shares[method] = follow(solver, OVAL, method, frames=100).run().reached.inside or 0.0
    assert shares["analytic"] > 0.95
    assert shares["constant"] < 0.7
    assert shares["none"] < 0.1


def test_a_goal_is_kept_for_the_frames_of_hold() -> None:
    following = follow(_solver(), OVAL, hold=60)
    result = following.run()
    inside = following.guidance.goal.inside(result.positions[-1].astype(np.float64))
    assert inside.mean() > 0.98


def test_late_input_costs_nothing() -> None:
    """The force is computed from the actual state: frames without it are made up for."""
    solver = _solver()
    guidance = prepare(solver, OVAL)
    solver.advance(8)
    solver.advance(guidance.frames - 8, guidance)
    inside = guidance.goal.inside(solver.positions.astype(np.float64))
    assert inside.mean() > 0.97


def test_it_can_be_cancelled() -> None:
    solver = _solver()
    following = follow(solver, OVAL, frames=40)
    for frame in following:
        if frame.frame == 7:
            following.cancel()
    assert (solver.frame, following.ending) == (7, "cancelled")
    assert following.result.frames == 7
    assert list(following) == []


def test_a_result_is_there_at_the_end_only() -> None:
    following = follow(_solver(), OVAL, frames=5)
    with pytest.raises(ConfigError, match="there at the end"):
        _ = following.result
    following.cancel()
    assert following.run().frames == 0
    assert following.result.reached.rms == 0


@pytest.mark.parametrize(
    "meddle",
    [
        lambda solver: solver.advance(1),
        lambda solver: solver.reset(),
        lambda solver: next(follow(solver, ARROW, frames=10)),
    ],
    ids=["advance", "reset", "second sketch"],
)
def test_a_simulator_that_others_move_is_left_to_them(meddle: Callable[[MpmSolver], object]) -> None:
    solver = _solver()
    following = follow(solver, OVAL, frames=40)
    for _ in range(3):
        next(following)
    meddle(solver)
    frame = solver.frame
    assert list(following) == []
    assert (solver.frame, following.ending, following.result.frames) == (frame, "superseded", 3)


def test_a_frame_that_fails_ends_it_with_the_state_before(monkeypatch: pytest.MonkeyPatch) -> None:
    solver = _solver()
    following = follow(solver, OVAL, frames=40)
    next(following)

    def fail(*_: Any) -> None:
        raise DomainError("particle 3 left the box in frame 2")

    monkeypatch.setattr(solver, "advance", fail)
    with pytest.raises(DomainError):
        next(following)
    assert following.ending == "failed"
    assert list(following) == []
    assert following.result.frames == 1


class _Still:
    """A method of one's own, and its law: it makes up for gravity."""

    name = "still"

    def plan(self, *_: Any) -> "_Still":
        return self

    def force(self, simulator: Any, _: int) -> Any:
        return -np.array(simulator.scene.gravity, dtype=np.float32)


def test_a_method_of_ones_own_may_stand_for_a_name() -> None:
    solver = _solver()
    following = follow(solver, OVAL, _Still(), frames=20)
    result = following.run()
    assert following.guidance.method == "still"
    np.testing.assert_allclose(result.displacement, 0, atol=1e-4)


def test_auto_says_why() -> None:
    solver = _solver()
    plain = prepare(solver, OVAL)
    assert (plain.method, bool(plain.reason)) == ("analytic", True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"frames": 0}, r"frames.*\[1, 10000\]"),
        ({"frames": True}, r"frames.*whole"),
        ({"cap": 0}, "cap must be a number in"),
        ({"strength": 1.5}, r"strength must be a number in \(0, 1\]"),
        ({"hold": -1}, "hold"),
        ({"fill": "half"}, "fill must be"),
        ({"resolution": 1000}, "resolution"),
        ({"method": "magic"}, "method must be auto, none, constant"),
        ({"method": 3}, "method must be a name or have the function plan"),
    ],
)
def test_bad_settings_are_refused_before_anything_moves(settings: dict[str, Any], message: str) -> None:
    solver = _solver()
    with pytest.raises(ConfigError, match=message):
        follow(solver, OVAL, **settings)
    assert solver.frame == 0


def test_a_sketch_must_be_one() -> None:
    with pytest.raises(ConfigError, match="an Arrow, an Ellipse, a Shape or a Solid, got ndarray"):
        follow(_solver(), np.zeros(3))  # type: ignore[arg-type]


def test_an_exploded_scene_is_gathered_as_far_as_the_cap_allows() -> None:
    solver = _solver()
    rng = np.random.default_rng(2)
    solver.advance(3, rng.normal(scale=3000, size=(solver.particle_count, 2)))
    result = follow(solver, OVAL).run()
    assert result.ending == "done"
    assert np.isfinite(result.positions).all()
    assert result.reached.inside is not None
    assert result.reached.inside > 0.8


def test_a_network_follows_too() -> None:
    bodies = [Box(lower=(0.3, 0.3), upper=(0.5, 0.5), material="water")]
    network = NeuralPhysics(Scene(dim=2, bodies=bodies), "zero")
    network.advance(24)
    result = follow(network, Arrow(np.array([[0.4, 0.3], [0.5, 0.5]])), frames=60).run()
    assert result.ending == "done"
    assert result.reached.miss < 0.03


def test_a_push_drags_what_is_near_along() -> None:
    solver = _solver(gravity=(0.0, 0.0))
    solver.advance(1)
    hand = push((0.25, 0.25), (1.0, 0.5), 0.05)
    force = hand(solver)
    away = np.linalg.norm(solver.positions - [0.25, 0.25], axis=1)
    assert (force[away > 0.05] == 0).all()
    middle = int(np.argmin(away))
    np.testing.assert_allclose(force[middle], np.array([1.0, 0.5]) / 0.01, rtol=0.02)
    solver.advance(8, hand)
    moved = solver.velocities[away < 0.02].mean(axis=0)
    assert moved[0] > 0.3
    assert np.linalg.norm(push((0.25, 0.25), (50.0, 0.0), 0.05)(solver), axis=1).max() <= 15 * 9.81 * 1.0001


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0.5,), (1.0,), 0.1), "point must be 2 or 3 finite numbers"),
        (((0.5, 0.5), (1.0, 0.0, 0.0), 0.1), "velocity must be 2 finite numbers"),
        (((0.5, 0.5), (1.0, 0.0), 0.0), "radius"),
        ((("a", "b"), (1.0, 0.0), 0.1), "point"),
    ],
)
def test_a_bad_push_is_refused(arguments: tuple[Any, Any, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        push(*arguments)


def test_a_push_in_another_dimension_is_refused() -> None:
    hand = push((0.5, 0.5), (1.0, 0.0), 0.1)
    with pytest.raises(ConfigError, match="point must be 3 finite numbers"):
        hand(_solver(3))


def test_an_oval_behind_an_obstacle_is_filled_around_it() -> None:
    ramp = SegmentObstacle(start=(0.1, 0.45), end=(0.5, 0.45), thickness=0.04)
    shares = {}
    for method in ("constant", "analytic"):
        solver = _solver(obstacles=[ramp])
        oval = Ellipse(np.array([0.35, 0.68]), np.array([0.1, 0.08]), 0.4)
        shares[method] = follow(solver, oval, method, frames=120).run().reached.inside or 0.0
    assert shares["analytic"] > 0.85
    assert shares["constant"] < 0.3


def test_a_goal_that_a_method_does_not_fill_is_reached_by_its_middle() -> None:
    filled = SketchResult(inside=0.4, inside_drawn=None, miss=0.001, rms=1.0, peak=2.0, near=0.01)
    assert not filled.goal
    led = dataclasses.replace(filled, fills=False)
    assert led.goal
    assert not dataclasses.replace(led, miss=0.02).goal

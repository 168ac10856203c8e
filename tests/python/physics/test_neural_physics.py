"""`NeuralPhysics`: laws that hold whatever the network, and what it shares with other simulators."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import torch
from tests.python.physics.conftest import TorchStepper, make_simulator

from hybridmpm import Ball, DomainError, MpmSolver, NeuralPhysics, NonFiniteError, Scene, scenarios
from hybridmpm.physics import NeuralModel
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.physics.track import StepPath, Track, warmup_frames
from hybridmpm.training.physics.network.simulator import LearnedSimulator

_Floats = npt.NDArray[np.float32]
DROP = Ball(material="water", center=(0.4, 0.7), radius=0.06, velocity=(0.5, 0.0), seed=3)
FALL = Scene(dim=2, resolution=128, bodies=(DROP,))
FREE_FALL = FreeFall(FALL.frame_dt, r_p=1 / 8, r_t=4)


class Stand:
    """A network's place, taken by a function."""

    def __init__(self, step: Callable[..., _Floats]) -> None:
        self.step, self.r_t, self.r_p = step, 4, 1 / 8

    def check(self, scene: Scene) -> None:
        """Take any scene."""


def falling(r_t: int = 4, *, show_all: bool = True) -> NeuralPhysics:
    """Return the drop under the zero network."""
    return NeuralPhysics(FALL, FreeFall(FALL.frame_dt, r_p=1 / 8, r_t=r_t), show_all=show_all)


@pytest.mark.parametrize("r_t", [1, 4, 16])
def test_zero_decoder_is_free_fall(r_t: int) -> None:
    """A network that answers zero leaves the known acceleration: g within 2 %, here to rounding."""
    simulator = make_simulator(scale=0.0, r_t=r_t)
    simulator.acceleration_mean.zero_()
    physics = NeuralPhysics(FALL, TorchStepper(simulator))
    physics.advance(5 * r_t)
    start, v = physics.positions.mean(0), physics.velocities.mean(0)
    path = physics.rollout(24).mean(1)
    t = np.arange(25)[:, None] * 0.0025
    wanted = start + v * t + np.array([0.0, -9.81]) * t**2 / 2
    np.testing.assert_allclose(path, wanted, atol=2e-4 * r_t)
    a = (path[24] - 2 * path[12] + path[0]) / (12 * 0.0025) ** 2 if r_t <= 4 else None
    if a is not None:
        np.testing.assert_allclose(a, [0.0, -9.81], atol=0.02 * 9.81)


def test_frames_within_a_step_are_those_of_free_fall() -> None:
    physics = falling(r_t=8)
    physics.advance(40)
    path = physics.rollout(16).astype(np.float64)
    bend = np.diff(path, n=2, axis=0) / 0.0025**2
    # Two steps, each an exact parabola; and the same g across the seam, since the steps of the solver
    # before them fall with g too.
    np.testing.assert_allclose(bend.mean((0, 1)), [0.0, -9.81], atol=0.2)
    np.testing.assert_allclose(bend[:7].mean(1), np.tile([0.0, -9.81], (7, 1)), atol=0.1)
    v = physics.velocities.mean(0)
    before = falling(r_t=8)
    before.advance(48)
    np.testing.assert_allclose(v - before.velocities.mean(0), [0.0, -9.81 * 8 * 0.0025], atol=1e-3)


def test_first_frames_are_the_solvers() -> None:
    physics, solver = falling(show_all=False), MpmSolver(FALL, r_p=1 / 8)
    assert warmup_frames(4) == 20
    for frame in range(21):
        assert physics.frame == frame
        assert physics.time == pytest.approx(solver.time)
        np.testing.assert_array_equal(physics.positions, solver.positions)
        np.testing.assert_array_equal(physics.velocities, solver.velocities)
        if frame < 20:
            physics.advance()
            solver.advance()
    physics.advance()
    assert not np.array_equal(physics.positions, MpmSolver(FALL, r_p=1 / 8).rollout(21)[-1])
    for name in ("materials", "mass", "ids", "particle_count", "dim"):
        np.testing.assert_array_equal(getattr(physics, name), getattr(solver, name))
    assert physics.positions.dtype == physics.velocities.dtype == np.float32


def test_the_copying_test(monkeypatch: pytest.MonkeyPatch) -> None:
    """A network that is handed the recorded accelerations rolls out to the recorded positions.

    All its answers count here: it is told what no network can know, as that a ramp comes within one step.
    """
    everywhere = torch.ones(1, 1)
    monkeypatch.setattr(
        "hybridmpm.training.physics.network.simulator.answer_weights", lambda *_, **__: everywhere
    )
    simulator = make_simulator()
    scene, steps, r_t = scenarios.water_ramps_2d(2), 30, 4
    truth = MpmSolver(scene, r_p=1 / 8).rollout((5 + steps) * r_t)[::r_t].astype(np.float64)
    answers = iter(_residuals(truth, simulator))

    def answer(x: torch.Tensor, _: torch.Tensor, types: torch.Tensor, *_rest: Any) -> torch.Tensor:
        found = torch.zeros_like(x)
        found[types != 3] = next(answers)
        return found

    simulator.network.forward = answer
    physics = NeuralPhysics(scene, TorchStepper(simulator), show_all=False)
    path = physics.rollout((5 + steps) * r_t)[::r_t]
    # Rounding to float32 at each step, 6e-8, adds up twice over 30 steps.
    np.testing.assert_allclose(path, truth, atol=2e-5)
    assert np.abs(path[-1] - path[5]).max() > 0.01


def _residuals(truth: npt.NDArray[np.float64], simulator: LearnedSimulator) -> list[torch.Tensor]:
    """Return normalised accelerations of a path (S, N, D) [m], gravity taken out, from state 5 on."""
    scales = simulator.scales
    bend = np.diff(truth, n=2, axis=0)[4:] - np.array([0.0, -9.81]) * simulator.spec.step_dt**2
    normal = (bend - scales.acceleration_mean) / scales.acceleration_std
    return [torch.tensor(row, dtype=torch.float32) for row in normal]


def test_long_rollouts_stay_within_the_walls(model: NeuralModel) -> None:
    physics = NeuralPhysics(scenarios.water_2d(1), model)
    path = physics.rollout(400)
    assert np.isfinite(path).all()
    assert ((path > 0.0999) & (path < 0.9001)).all()


def test_a_force_is_as_good_as_gravity() -> None:
    heavy = Scene(dim=2, resolution=128, bodies=(DROP,), gravity=(1.5, -12.0))
    one = NeuralPhysics(heavy, FreeFall(FALL.frame_dt, r_p=1 / 8, r_t=4))
    two = falling()
    push = np.tile(np.array([1.5, -12.0 + 9.81], np.float32), (two.particle_count, 1))
    paths = [one.rollout(40), two.rollout(40, push)]
    np.testing.assert_allclose(paths[0], paths[1], atol=2e-5)


def test_a_force_within_a_step_gives_its_impulse() -> None:
    """A force of a few frames changes the velocity by its time integral, wherever in a step it begins."""
    gain = np.array([8.0, 0.0], np.float32)
    for first in range(20, 25):
        pushed, plain = falling(show_all=False), falling(show_all=False)
        force = np.zeros((20, pushed.particle_count, 2), np.float32)
        force[first - 20 : first - 17] = gain
        pushed.advance(20)
        plain.advance(20)
        path = pushed.rollout(20, force) - plain.rollout(20)
        # Nothing moves before the force, all goes on evenly after it, and there is no jump.
        assert np.abs(path[: first - 19]).max() <= 1e-6
        np.testing.assert_allclose(
            (pushed.velocities - plain.velocities).mean(0), 3 * gain * 0.0025, atol=1e-4
        )
        assert np.abs(np.diff(path, axis=0)).max() <= 1.6 * 3 * 8.0 * 0.0025 * 0.0025


@pytest.mark.parametrize(
    ("value", "kind", "message"),
    [
        (np.nan, NonFiniteError, "particle 3 became non-finite in frame 25"),
        (np.inf, NonFiniteError, "particle 3 became non-finite in frame 25"),
        (1.5, DomainError, "particle 3 left the domain in frame 25"),
    ],
)
def test_failing_networks_are_told(value: float, kind: type[Exception], message: str) -> None:
    fall, calls = FREE_FALL.step, []

    def step(*known: Any) -> _Floats:
        calls.append(1)
        after = fall(*known)
        if len(calls) == 2:
            after[3, 1] = value
        return after

    physics = NeuralPhysics(FALL, Stand(step))
    physics.advance(22)
    with pytest.raises(kind, match=message):
        physics.advance(10)
    assert physics.frame == 24
    good = falling()
    good.advance(24)
    np.testing.assert_array_equal(physics.positions, good.positions)
    np.testing.assert_array_equal(physics.velocities, good.velocities)


def test_an_impact_is_a_straight_line() -> None:
    """What comes to rest on the floor is not thrown back between frames."""
    before, now, after = (np.array([[0.5, y]], np.float32) for y in (0.14, 0.11, 0.1))
    known = np.array([[0.0, -0.001]], np.float32)
    path = StepPath.between(before, now, after, known)
    np.testing.assert_allclose([path.at(s)[0, 1] for s in (0.0, 0.5, 1.0)], [0.11, 0.105, 0.1], atol=1e-7)
    np.testing.assert_allclose(path.velocity(1.0), [[0.0, -0.01]], atol=1e-7)
    at_rest = StepPath.between(after, after, after, known)
    np.testing.assert_array_equal(at_rest.at(0.5), after)


def test_changed_paths_have_no_jump() -> None:
    rng = np.random.default_rng(0)
    now = rng.uniform(0.3, 0.6, (20, 2)).astype(np.float32)
    v = rng.normal(0, 0.01, (20, 2)).astype(np.float32)
    known = np.tile(np.array([0.0, -0.001], np.float32), (20, 1))
    path = StepPath.between(now - v, now, now + v + known, known)
    change = np.tile(np.array([0.002, 0.0], np.float32), (20, 1))
    lower, upper = np.full(2, 0.1, np.float32), np.full(2, 0.9, np.float32)
    turned = path.pushed(0.25, change, lower, upper)
    np.testing.assert_array_equal(turned.at(0.25), path.at(0.25))
    np.testing.assert_allclose(turned.at(1.0), path.at(1.0) + 0.75 * change, atol=1e-7)
    # Taken back at once, it is as if it had not been.
    back = turned.pushed(0.25, -change, lower, upper)
    np.testing.assert_allclose(back.at(0.6), path.at(0.6), atol=1e-7)
    np.testing.assert_allclose(back.velocity(0.6), path.velocity(0.6), atol=1e-6)


def test_a_track_needs_its_history() -> None:
    track = Track(FREE_FALL, FALL, np.full(3, 5))
    track.observe(np.full((3, 2), 0.5, np.float32))
    assert not track.ready
    with pytest.raises(RuntimeError, match="the network needs 6 states, got 1"):
        track.predict()
    with pytest.raises(RuntimeError, match="no step of the network is under way"):
        _ = track.velocities

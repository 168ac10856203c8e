"""The synchronous heart of a session: control is applied, failures keep the last good state."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import Box, DomainError, MpmSolver, NeuralPhysics, Scene
from hybridmpm.control import Arrow, follow
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm_service.sessions.frames import decode
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver

SCENE = Scene(
    dim=2,
    resolution=32,
    bodies=(Box(lower=(0.4, 0.4), upper=(0.6, 0.6), material="water", velocity=(0.3, 0.0)),),
)
ARROW = Arrow(np.array([[0.5, 0.5], [0.6, 0.55]]))


class _Recorded:
    """A method, and its law, that plays back forces."""

    name = "recorded"

    def __init__(self, forces: Any) -> None:
        self._forces = forces

    def plan(self, *_: Any) -> "_Recorded":
        return self

    def force(self, _: Any, index: int) -> Any:
        return self._forces[index]


class _Clock:
    """A clock that moves by a millisecond whenever it is read."""

    now = 0.0

    def __call__(self) -> float:
        self.now += 0.001
        return self.now


def _simulation() -> Simulation:
    return Simulation(ChosenSolver(MpmSolver(SCENE)), clock=_Clock())


def test_it_computes_what_the_library_computes() -> None:
    simulation, solver = _simulation(), MpmSolver(SCENE)
    assert simulation.advance(20) == 20
    solver.advance(20)
    particles = simulation.particles()
    assert (particles.frame, particles.time) == (20, solver.time)
    assert np.array_equal(particles.positions, solver.positions)
    assert np.array_equal(particles.velocities, solver.velocities)
    assert np.array_equal(particles.types, solver.materials)


def test_a_sketch_steers_for_its_frames_and_then_no_more() -> None:
    simulation = _simulation()
    simulation.advance(3)
    plan = simulation.steer(ARROW, 10)
    control = simulation.look().control
    assert control is not None
    assert (control.kind, control.first_frame, control.frames_done, control.frames) == ("arrow", 3, 0, 10)
    simulation.advance(4)
    assert np.array_equal(simulation.particles().positions, plan.positions[4])
    simulation.advance(6)
    view = simulation.look()
    assert view.control is None
    assert decode(view.message).steered
    assert np.array_equal(simulation.particles().positions, plan.positions[10])
    free = MpmSolver(SCENE)
    free.advance(3)
    free.advance(10, plan.force)
    free.advance(1)
    simulation.advance(1)
    assert not decode(simulation.look().message).steered
    assert np.array_equal(simulation.particles().positions, free.positions)


def test_a_force_may_change_from_frame_to_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation, solver = _simulation(), MpmSolver(SCENE)
    force = np.random.default_rng(1).normal(size=(4, solver.particle_count, 2)).astype(np.float32)
    law = _Recorded(force)
    monkeypatch.setattr(
        "hybridmpm_service.sessions.simulation.follow",
        lambda solver, sketch, _, **more: follow(solver, sketch, law, **more),
    )
    simulation.steer(ARROW, 4)
    simulation.advance(5)
    solver.advance(4, force)
    solver.advance(1)
    assert np.array_equal(simulation.particles().positions, solver.positions)


def test_a_newer_sketch_replaces_an_older_one() -> None:
    simulation = _simulation()
    simulation.steer(ARROW, 10)
    simulation.advance(2)
    plan = simulation.steer(Arrow(np.array([[0.5, 0.5], [0.45, 0.5]])), 5)
    simulation.advance(5)
    assert simulation.look().control is None
    assert np.array_equal(simulation.particles().positions, plan.positions[-1])


def test_reset_goes_back_to_the_start_without_control() -> None:
    simulation = _simulation()
    start = simulation.particles().positions
    simulation.steer(ARROW, 10)
    simulation.advance(2)
    simulation.reset()
    view = simulation.look()
    assert (view.frame, view.control, view.last_frame) == (0, None, None)
    assert np.array_equal(simulation.particles().positions, start)


def test_a_failing_frame_leaves_the_state_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = _simulation()
    advance = MpmSolver.advance

    def fail_at_five(solver: MpmSolver, frames: int = 1, force: Any = None) -> None:
        if solver.frame == 5:
            raise DomainError("particle 1 left the box in frame 6")
        advance(solver, frames, force)

    monkeypatch.setattr(MpmSolver, "advance", fail_at_five)
    with pytest.raises(DomainError):
        simulation.advance(10)
    assert simulation.look().frame == 5


def test_it_stops_when_it_is_told_to() -> None:
    simulation = _simulation()
    left = iter([True, True, False])
    assert simulation.advance(10, lambda: next(left)) == 2
    assert simulation.look().frame == 2


def test_it_tells_how_fast_frames_come() -> None:
    simulation = _simulation()
    assert simulation.timing().ms_per_frame == 0
    simulation.advance(10)
    timing = simulation.timing()
    # Two readings of the clock a frame, the second a millisecond after the first.
    assert timing.ms_per_frame == pytest.approx(1.0)
    assert timing.ms_p95 == pytest.approx(1.0)
    assert timing.time_scale == pytest.approx(10 * 0.0025)


def test_the_work_of_a_network_step_is_shared_by_its_frames() -> None:
    clock = _Clock()

    class Slow(FreeFall):
        """Takes 8 ms for 4 frames."""

        def step(self, *arguments: Any, **options: Any) -> Any:
            clock.now += 0.008
            return super().step(*arguments, **options)

    physics = NeuralPhysics(SCENE, Slow(SCENE.frame_dt, r_t=4))
    simulation = Simulation(ChosenSolver(physics, "slow"), clock=clock)
    simulation.advance(80)
    assert simulation.timing().ms_per_frame == pytest.approx(1 + 8 / 4)

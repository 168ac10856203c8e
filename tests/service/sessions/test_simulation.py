"""The synchronous heart of a session: control is applied, failures keep the last good state."""

from typing import Any

import numpy as np
import pytest
from tests.service.conftest import ARROW, JET, OVAL, SCENE

from hybridmpm import BoxSink, HybridSimulator, MpmSolver, NeuralPhysics
from hybridmpm.control import follow, prepare, push
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm.simulator import Simulator
from hybridmpm.stream_frames import decode
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver


class _Clock:
    """A clock that moves by a millisecond whenever it is read."""

    now = 0.0

    def __call__(self) -> float:
        self.now += 0.001
        return self.now


def _simulation() -> Simulation:
    return Simulation(ChosenSolver(MpmSolver(SCENE)), clock=_Clock())


def test_what_was_reached_is_what_following_the_sketch_reports() -> None:
    simulation, solver = _simulation(), MpmSolver(SCENE)
    simulation.steer(prepare(simulation.copy(), OVAL, frames=60), 1, {"most": 400})
    simulation.advance(60)
    control = simulation.view().control
    reached = follow(solver, OVAL, frames=60).run().reached
    assert (control.inside, control.inside_drawn) == (reached.inside, reached.inside_drawn)
    assert control.inside is not None
    assert control.inside > 0.9
    assert control.miss == pytest.approx(reached.miss)


def test_a_sketch_that_is_taken_back_steers_no_more() -> None:
    simulation, solver = _simulation(), MpmSolver(SCENE)
    guidance = prepare(simulation.copy(), ARROW, frames=10)
    simulation.steer(guidance, 1, {"most": 400})
    simulation.advance(4)
    simulation.release()
    simulation.advance(4)
    solver.advance(4, guidance)
    solver.advance(4)
    assert simulation.view().control is None
    assert np.array_equal(simulation.particles().positions, solver.positions)


def test_reset_goes_back_to_the_start_without_control() -> None:
    simulation = _simulation()
    start = simulation.particles().positions
    simulation.steer(prepare(simulation.copy(), ARROW, frames=10), 1, {"most": 400})
    simulation.hand = push((0.5, 0.5), (1, 0), 0.1)
    simulation.advance(2)
    simulation.reset()
    view = simulation.view()
    assert (view.frame, view.control, view.last_frame) == (0, None, None)
    assert np.array_equal(simulation.particles().positions, start)
    simulation.advance(5)
    solver = MpmSolver(SCENE)
    solver.advance(5)
    assert np.array_equal(simulation.particles().positions, solver.positions)


@pytest.mark.parametrize("method", ["none", "constant", "analytic"])
def test_a_hand_pushes_beside_a_sketch(method: str) -> None:
    simulation, solver = _simulation(), MpmSolver(SCENE)
    hand = push((0.5, 0.5), (1.0, 0.5), 0.08)
    guidance = prepare(simulation.copy(), ARROW, method=method, frames=40)
    simulation.steer(guidance, 1, {"most": 400})
    simulation.hand = hand
    simulation.advance(3)
    simulation.hand = None
    simulation.advance(2)

    def both(now: Simulator) -> Any:
        force = guidance(now)
        return hand(now) if force is None else force + hand(now)  # type: ignore[operator]

    solver.advance(3, both)
    solver.advance(2, guidance)
    assert np.array_equal(simulation.particles().positions, solver.positions)


def test_it_stops_when_it_is_told_to() -> None:
    simulation = _simulation()
    left = iter([True, True, False])
    assert simulation.advance(10, lambda: next(left)) == 2
    assert simulation.view().frame == 2


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


def test_a_frame_costs_the_lower_quartile_of_the_latest() -> None:
    clock = _Clock()
    simulation = Simulation(ChosenSolver(MpmSolver(SCENE)), clock=clock)
    assert simulation.frame_seconds is None
    simulation.advance(20)
    assert simulation.frame_seconds == pytest.approx(0.001)


def test_a_scene_that_has_run_empty_has_no_centroid() -> None:
    drain = BoxSink(lower=(0.3, 0.3), upper=(0.7, 0.7))
    solver = MpmSolver(SCENE.model_copy(update={"sinks": (drain,)}))
    simulation = Simulation(ChosenSolver(solver), clock=_Clock())
    simulation.advance(1)
    view = simulation.view()
    assert (view.particles, view.centroid) == (0, None)
    assert decode(view.message.of(2)).positions.shape == (0, 2)


def test_what_a_sketch_reached_counts_who_is_still_there() -> None:
    scene = SCENE.model_copy(
        update={"emitters": (JET,), "sinks": (BoxSink(lower=(0.4, 0.3), upper=(0.45, 0.7)),)}
    )
    simulation, solver = Simulation(ChosenSolver(MpmSolver(scene)), clock=_Clock()), MpmSolver(scene)
    simulation.steer(prepare(simulation.copy(), ARROW, frames=20), 1, {"most": 400})
    simulation.advance(20)
    control = simulation.view().control
    following = follow(solver, ARROW, frames=20).run()
    assert np.array_equal(simulation.particles().positions, solver.positions)
    assert np.isnan(following.positions[-1]).any()
    assert control.miss is not None
    assert control.miss < 0.2


def test_a_fork_of_a_hybrid_session_keeps_its_record() -> None:
    solver = HybridSimulator(SCENE, FreeFall(SCENE.frame_dt, r_t=1))
    simulation = Simulation(ChosenSolver(solver, "zero", 0.8), clock=_Clock())
    simulation.advance(45)
    fork = simulation.fork()
    for each in (simulation, fork):
        each.advance(25)
    assert fork.view().safeguard == simulation.view().safeguard
    assert fork.copy().snapshot() == simulation.copy().snapshot()

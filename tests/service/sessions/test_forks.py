"""A fork goes on from the state of a session, with the same bits and by itself."""

import hashlib
import time

import numpy as np
import pytest

from hybridmpm import Box, BoxSink, HybridSimulator, MpmSolver, RectangularEmitter, Scene
from hybridmpm.control import Ellipse, prepare
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver

SCENE = Scene(
    dim=2,
    resolution=32,
    bodies=(Box(lower=(0.4, 0.4), upper=(0.6, 0.6), material="water", velocity=(0.3, 0.0)),),
)
OPEN_SCENE = SCENE.model_copy(
    update={
        "emitters": (
            RectangularEmitter(lower=(0.1, 0.6), upper=(0.1, 0.7), material="sand", velocity=(2.0, 0.0)),
        ),
        "sinks": (BoxSink(lower=(0.4, 0.0), upper=(0.6, 0.5)),),
    }
)
OVAL = Ellipse(np.array([0.55, 0.6]), np.array([0.15, 0.1]), 0.3)


@pytest.mark.parametrize("sketch", [None, OVAL])
def test_a_fork_goes_on_with_the_same_bits_and_by_itself(sketch: Ellipse | None) -> None:
    simulation = Simulation(ChosenSolver(MpmSolver(OPEN_SCENE)), clock=time.perf_counter)
    if sketch is not None:
        simulation.steer(prepare(simulation.copy(), sketch, frames=20, hold=5), 1, {"most": 400})
    simulation.advance(7)
    fork = simulation.fork()
    before = _digest(simulation)
    assert _digest(fork) == before
    fork.advance(22)
    assert _digest(simulation) == before
    simulation.advance(22)
    assert _digest(fork) == _digest(simulation)
    assert fork.view().control == simulation.view().control
    fork.reset()
    assert fork.view().frame == 0


def test_a_fork_of_a_hybrid_session_keeps_its_record() -> None:
    solver = HybridSimulator(SCENE, FreeFall(SCENE.frame_dt, r_t=1))
    simulation = Simulation(ChosenSolver(solver, "zero", 0.8), clock=time.perf_counter)
    simulation.advance(45)
    fork = simulation.fork()
    for each in (simulation, fork):
        each.advance(25)
    assert fork.view().safeguard == simulation.view().safeguard
    assert _digest(fork) == _digest(simulation)


def _digest(simulation: Simulation) -> str:
    return hashlib.sha256(simulation.copy().snapshot()).hexdigest()

"""A fork goes on from the state of a session, with the same bits and by itself."""

import hashlib
import time

import pytest
from tests.service.conftest import OPEN_SCENE, OVAL, SCENE

from hybridmpm import HybridSimulator, MpmSolver
from hybridmpm.control import Ellipse, prepare
from hybridmpm.physics.free_fall import FreeFall
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver


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

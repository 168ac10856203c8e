"""Sessions whose particles come and go."""

import time

import numpy as np
from tests.service.conftest import ARROW, JET, SCENE

from hybridmpm import BoxSink, MpmSolver
from hybridmpm.control import follow, prepare
from hybridmpm.stream_frames import decode
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import ChosenSolver


def test_a_scene_that_has_run_empty_has_no_centroid() -> None:
    drain = BoxSink(lower=(0.3, 0.3), upper=(0.7, 0.7))
    solver = MpmSolver(SCENE.model_copy(update={"sinks": (drain,)}))
    simulation = Simulation(ChosenSolver(solver), clock=time.perf_counter)
    simulation.advance(1)
    view = simulation.view()
    assert (view.particles, view.centroid) == (0, None)
    assert decode(view.message.of(2)).positions.shape == (0, 2)


def test_what_a_sketch_reached_counts_who_is_still_there() -> None:
    scene = SCENE.model_copy(
        update={"emitters": (JET,), "sinks": (BoxSink(lower=(0.4, 0.3), upper=(0.45, 0.7)),)}
    )
    simulation, solver = Simulation(ChosenSolver(MpmSolver(scene)), clock=time.perf_counter), MpmSolver(scene)
    simulation.steer(prepare(simulation.copy(), ARROW, frames=20), 1, {"most": 400})
    simulation.advance(20)
    control = simulation.view().control
    following = follow(solver, ARROW, frames=20).run()
    assert control is not None
    assert np.array_equal(simulation.particles().positions, solver.positions)
    assert np.isnan(following.positions[-1]).any()
    assert control.miss is not None
    assert control.miss < 0.2

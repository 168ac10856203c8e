"""Copies and pickles go on with the same bits, share nothing that changes, and reach other processes."""

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from operator import methodcaller
from typing import Any

import numpy as np
import pytest

from hybridmpm import (
    AutoSolver,
    BallSink,
    BoxObstacle,
    CancelFlag,
    HybridSimulator,
    MpmBatch,
    MpmSolver,
    NeuralPhysics,
    Simulator,
    Sleep,
    check,
    control,
    plan,
    radius_graph,
    recording,
    scenarios,
)
from hybridmpm._core import MotionReport
from hybridmpm.physics.model import NeuralModel

SCENE = scenarios.water_2d(seed=3)
SINK = BallSink(center=(0.5, 0.15), radius=0.04)
SIMULATORS: dict[str, Callable[[], Simulator]] = {
    "mpm": lambda: MpmSolver(SCENE),
    "mpm with settings": lambda: MpmSolver(SCENE, substeps=80, sleep=Sleep(), threads=2),
    "mpm merged": lambda: MpmSolver(SCENE, r_p=0.5),
    "coarse": lambda: MpmSolver(SCENE, coarse="1/4"),
    "open": lambda: MpmSolver(SCENE.model_copy(update={"sinks": (SINK,)})),
    "neural": lambda: NeuralPhysics(SCENE, "zero"),
    "network": lambda: NeuralPhysics(SCENE, "fluids_2d"),
    "hybrid": lambda: HybridSimulator(SCENE, "fluids_2d", r_c=0.5),
    "auto": lambda: AutoSolver(SCENE, budget_ms=1e4, clock=_still),
}


def _pickled(protocol: int, one: Any) -> Any:
    return pickle.loads(pickle.dumps(one, protocol))  # noqa: S301 - our own


WAYS: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    **{
        f"pickle {protocol}": partial(_pickled, protocol)
        for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)
    },
}


def _still() -> float:
    return 0.0


def _state(simulator: Simulator) -> tuple[object, ...]:
    return (
        simulator.snapshot(),
        simulator.positions.tobytes(),
        simulator.velocities.tobytes(),
        repr(simulator.last_frame),
        repr(simulator.diagnostics()),
        simulator.log,
        repr(simulator),
    )


@pytest.mark.parametrize("kind", SIMULATORS)
def test_copies_and_pickles_go_on_with_the_same_bits(kind: str) -> None:
    simulator = SIMULATORS[kind]()
    simulator.advance(13)
    before = _state(simulator)
    twins = {way: make(simulator) for way, make in WAYS.items()}
    for way, twin in twins.items():
        assert type(twin) is type(simulator)
        assert _state(twin) == before, way
        twin.advance(2)
    assert _state(simulator) == before, "a copy moves nothing of the original"
    simulator.advance(2)
    for way, twin in twins.items():
        assert _state(twin) == _state(simulator), way
        twin.reset()
        assert twin.frame == 0


@pytest.mark.parametrize("way", WAYS)
def test_reports_and_what_else_is_kept_survive(way: str) -> None:
    solver = MpmSolver(SCENE)
    solver.advance(3)
    graph = radius_graph(solver.positions, 0.02)
    flag = CancelFlag()
    flag.set()
    kept = {
        "diagnostics": solver.diagnostics(),
        "report": solver.last_frame,
        "motion": MotionReport(0.1, 2.0, 3.0, -4.0),
        "recording": recording.record(MpmSolver(SCENE), 2),
        "check": check(SCENE),
        "plan": plan(SCENE, max_error=0.5),
        "sketch": control.Arrow([(0.2, 0.2), (0.6, 0.5)]),
        "flag": flag.is_set,
        "senders": graph.senders,
    }
    twins = WAYS[way](kept)
    for name, one in kept.items():
        assert repr(twins[name]) == repr(one), name
    found = WAYS[way](graph)
    assert np.array_equal(found.receivers, graph.receivers)
    assert not np.shares_memory(found.starts, graph.starts)
    ours = WAYS[way](flag)
    assert ours.is_set
    batch = MpmBatch([SCENE])
    twin = WAYS[way](batch)
    twin.advance(2)
    assert (batch[0].frame, twin[0].frame) == (0, 2)
    model = NeuralModel.load("fluids_2d")
    assert WAYS[way](model).sha256 == model.sha256


@pytest.mark.parametrize("way", ["deepcopy", "pickle 5"])
@pytest.mark.parametrize("method", ["analytic", "controlnet"])
@pytest.mark.parametrize("obstacles", [(), (BoxObstacle(lower=(0.5, 0.1), upper=(0.54, 0.4)),)], ids=len)
def test_a_followed_sketch_goes_on_with_the_same_bits(obstacles: Any, method: str, way: str) -> None:
    solver = MpmSolver(SCENE.model_copy(update={"obstacles": obstacles}))
    solver.advance(20)
    following = control.follow(solver, control.Arrow([(0.3, 0.3), (0.7, 0.5)]), method, frames=100)
    for _ in range(5):
        next(following)
    twin = WAYS[way](following)
    for _ in range(3):
        assert next(twin).force.tobytes() == next(following).force.tobytes()
    assert twin.simulator is not solver
    assert twin.simulator.snapshot() == solver.snapshot()
    assert twin.guidance.needs() == following.guidance.needs()


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_simulators_and_reports_cross_processes(method: str) -> None:
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip("no forkserver here")
    simulator = MpmSolver(SCENE)
    simulator.advance(2)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context(method)) as pool:
        # Functions of a test cannot be imported by another process.
        twin = pool.submit(copy.copy, simulator).result()
        totals = pool.submit(methodcaller("diagnostics"), simulator).result()
    assert twin.snapshot() == simulator.snapshot()
    assert repr(totals) == repr(simulator.diagnostics())

"""The time of a frame of methods: pieces of one rollout, by turns."""

import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from functools import partial

import numpy as np

from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import SimulationError
from hybridmpm.planner.calibrating.impact import first_frame
from hybridmpm.scene import Scene
from hybridmpm_lab.compare import peers
from hybridmpm_lab.compare.methods import Method
from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.harness.timing import Calibration, TimedCall, seconds_by_turns
from hybridmpm_lab.speed.baselines.process import baseline_process

FIELDS = ("ms_per_frame", "ms_p95", "slowdown")
"""Fields of a row about its time."""
PIECE = 8
"""Frames of a piece: two updates of the shown particles, and one or two steps of each shipped network."""
_APART = 2 * PIECE
"""Frames from the start of a piece to that of the next."""


def times(
    methods: Mapping[str, Method], scene: Scene, *, warm_up: int, span: int, passes: int, threads: int
) -> Iterator[tuple[str, Row]]:
    """Yield the name and the fields of the time of each method on a scene; None where it fails.

    The pieces lie in the `span` frames after the first impact, or after the warm-up where that is later. All
    pieces of all methods are timed once in each of the `passes`. Of the settings of a peer the quickest
    counts.
    """
    start = first_frame(scene, warm_up)
    timed: list[tuple[str, int, list[TimedCall]]] = []
    with ExitStack() as stack, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the rows of errors count them
        for name, method in methods.items():
            try:
                if method.make is not None:
                    timed.append((name, threads, _pieces(method.make(scene, threads), start, span)))
                else:
                    baseline = stack.enter_context(baseline_process(method.label))
                    settings = peers.pieces(baseline, scene, start, span, PIECE)
                    timed += [(name, its_threads, calls) for its_threads, calls in settings]
            except SimulationError:
                yield name, dict.fromkeys(FIELDS) | {"threads": threads}
        calls = [call for *_, mine in timed for call in mine]
        seconds = seconds_by_turns([*calls, TimedCall(call=Calibration(threads).slowdown)], passes)
    quartiles = [float(np.percentile(mine, 25)) for mine in seconds]
    slowdown = significant(quartiles.pop(), 3)
    rows: dict[str, Row] = {}
    for name, its_threads, mine in timed:
        ms = [1e3 * quartiles.pop(0) for _ in mine]
        row = {
            "ms_per_frame": significant(float(np.median(ms))),
            "ms_p95": significant(float(np.percentile(ms, 95))),
            "slowdown": slowdown,
            "threads": its_threads,
        }
        rows[name] = min(rows.get(name, row), row, key=lambda one: one["ms_per_frame"])
    yield from rows.items()


def _pieces(simulator: CoarseSimulator, start: int, span: int) -> list[TimedCall]:
    calls = []
    for frame in range(start, start + span - PIECE, _APART):
        simulator.advance(frame - simulator.frame)
        prepare = partial(_prepare, simulator, simulator.snapshot())
        calls.append(TimedCall(prepare=prepare, call=partial(_shown, simulator)))
    simulator.advance(start + span - simulator.frame)
    return calls


def _prepare(simulator: CoarseSimulator, snapshot: bytes) -> None:
    """Return to a state, and touch the memory that the others used meanwhile by one frame."""
    simulator.restore(snapshot)
    simulator.advance(1)
    _ = simulator.positions


def _shown(simulator: CoarseSimulator) -> float:
    """Return the time of a frame of a piece [s], each looked at."""
    began = time.perf_counter()
    for _ in range(PIECE):
        simulator.advance(1)
        _ = simulator.positions
    return (time.perf_counter() - began) / PIECE

"""The time of a frame of all entrants, by turns, on the largest of a hundred scenes of a scenario."""

import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.impact import first_frame
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.accuracy.methods import reference_scene
from hybridmpm_lab.compare.tradeoff.entrants import entrants
from hybridmpm_lab.compare.tradeoff.errors import PEER
from hybridmpm_lab.compare.tradeoff.peers import PeerTiming, can_simulate, reference_substeps
from hybridmpm_lab.compare.tradeoff.settings import TradeoffSettings, warm_up
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.harness.timing import Calibration
from hybridmpm_lab.speed.baselines.process import Worker

PART = "times"
"""First field of the keys of these rows; scenario and name follow."""
PIECE = 8
"""Frames of a piece: two carries, and one or two steps of each shipped network."""
_TURN = 5 * PIECE
"""Frames that a simulation goes on in one turn; the first piece of five finds the caches of others."""
QUIET = 1.15
"""Slowdown of the machine from which on a time counts as taken under load [-]."""
FIELDS = ("ms_per_frame", "ms_p95", "ms_mean", "ms_frame_p95", "slowdown")
"""Fields of a row that tell of its time."""

_Seconds = npt.NDArray[np.float64]


class Timed(Protocol):
    """A simulation that can go back to the frame from which it is timed."""

    def restore(self) -> None:
        """Go back."""

    def advance(self, frames: int) -> Sequence[float]:
        """Go on, and return the time of each frame [s]."""


class OwnTiming:
    """One of our simulators, whose positions are read after each frame.

    Parameters
    ----------
    simulator : CoarseSimulator
        At the frame from which it is timed.
    """

    def __init__(self, simulator: CoarseSimulator) -> None:
        self._simulator, self._start = simulator, simulator.snapshot()

    def restore(self) -> None:
        """Go back."""
        self._simulator.restore(self._start)

    def advance(self, frames: int) -> Sequence[float]:
        """Go on, and return the time of each frame and of looking at it [s]."""
        spent = []
        for _ in range(frames):
            began = time.perf_counter()
            self._simulator.advance(1)
            _ = self._simulator.positions
            spent.append(time.perf_counter() - began)
        return spent


@dataclass(frozen=True, kw_only=True)
class Times:
    """Times of one simulation, and how slow the machine was meanwhile."""

    seconds: _Seconds
    """Time of each frame (F,) [s]: the lower quartile over the passes, for others only ever add time."""
    slowdown: float
    """Lower quartile over the passes of the machine's slowdown, the largest of the turns [-]."""

    def fields(self) -> Row:
        """Return median, 95th percentile and mean of the pieces, and the 95th percentile of frames [ms]."""
        pieces = 1e3 * self.seconds.reshape(-1, PIECE).mean(axis=1)
        return {
            "ms_per_frame": significant(float(np.median(pieces))),
            "ms_p95": significant(float(np.percentile(pieces, 95))),
            "ms_mean": significant(float(pieces.mean())),
            "ms_frame_p95": significant(float(np.percentile(1e3 * self.seconds, 95))),
            "slowdown": significant(self.slowdown, 3),
        }


def by_turns(timed: Sequence[Timed], span: int, passes: int, threads: int) -> list[Times | None]:
    """Time simulations over the same frames by turns, several times; None for those that fail.

    `span` is rounded down to whole pieces.
    """
    span -= span % PIECE
    calibration = Calibration(threads)
    seconds: list[list[list[float]]] = [[] for _ in timed]
    slow: list[list[float]] = []
    failed = set()
    for _ in range(passes):
        for one, mine in zip(timed, seconds, strict=True):
            one.restore()
            mine.append([])
        slow.append([])
        for begin in range(0, span, _TURN):
            slow[-1].append(calibration.slowdown())
            for index, one in enumerate(timed):
                if index in failed:
                    continue
                try:
                    seconds[index][-1] += one.advance(min(_TURN, span - begin))
                except SimulationError:
                    failed.add(index)
    slowdown = float(np.percentile(slow, 25, axis=0).max())
    return [
        None if index in failed else Times(seconds=np.percentile(mine, 25, axis=0), slowdown=slowdown)
        for index, mine in enumerate(seconds)
    ]


def measure_times(
    settings: TradeoffSettings, runs: RowStore, origin: Provenance, on_progress: Progress
) -> None:
    """Time all entrants and peers of the scenarios that are missing; `on_progress` counts scenarios.

    All of a scenario are timed together, so one that is missing lets all be timed again.
    """
    for scenario in settings.scenarios:
        names = list(entrants(scenario, settings.patterns))
        scene = reference_scene(scenario)
        names += [f"{PEER} {one}" for one in settings.peers if can_simulate(scene)]
        if not all((PART, scenario, name) in runs for name in names):
            for name, row in _scenario_times(scenario, scene, settings):
                runs.add((PART, scenario, name), origin.stamped(row))
        on_progress(1)


def _scenario_times(scenario: str, scene: Scene, settings: TradeoffSettings) -> Iterator[tuple[str, Row]]:
    start = first_frame(scene, warm_up(scenario))
    timed: list[Timed] = []
    facts: list[tuple[str, Row]] = []
    with ExitStack() as stack:
        for name, entrant in entrants(scenario, settings.patterns).items():
            facts.append((name, {"setting": None, "threads": settings.threads}))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the rows of errors tell of them
                simulator = entrant.make(scene, settings.threads)
                try:
                    simulator.advance(start)
                except SimulationError:
                    yield name, dict.fromkeys(FIELDS)
                    facts.pop()
                    continue
            timed.append(OwnTiming(simulator))
        for package in settings.peers if can_simulate(scene) else ():
            for setting, threads, one in _peer_timings(stack.enter_context(Worker(package)), scene, start):
                facts.append((f"{PEER} {package}", {"setting": setting, "threads": threads}))
                timed.append(one)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            times = by_turns(timed, settings.span, settings.passes, settings.threads)
    best: dict[str, Row] = {}
    for (name, more), spent in zip(facts, times, strict=True):
        row = dict.fromkeys(FIELDS) if spent is None else spent.fields()
        row |= more | {"start": start, "particles": len(scene.sample().x)}
        quickest = best.get(name, row)["ms_per_frame"]
        if row["ms_per_frame"] is not None and (quickest is None or row["ms_per_frame"] <= quickest):
            best[name] = row
        best.setdefault(name, row)
    yield from best.items()


def _peer_timings(worker: Worker, scene: Scene, start: int) -> Iterator[tuple[str, int, PeerTiming]]:
    """Yield all settings of a peer, at the state of our solver."""
    solver = MpmSolver(scene, substeps="reference")
    solver.advance(start)
    worker.call("start")
    worker.call("take", solver.positions, solver.velocities, solver.affine, solver.volume_ratio)
    substeps = reference_substeps(scene)
    for setting, threads in worker.call("settings").items():
        yield setting, threads, PeerTiming(worker, setting, scene, substeps)

"""Time of a frame of several solvers, by turns, looked at and not."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_impact
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.accuracy.methods import reference_scene
from hybridmpm_lab.harness.timing import TimedSimulation, time_per_frame

_FROM = (20, 90, 160)
"""Frames after the first impact from which pieces are timed: while most of it splashes, and later."""
_PIECE = 20
"""Frames of a piece; it holds as many carries wherever it begins."""


@dataclass(frozen=True, kw_only=True)
class FrameTimes:
    """Processor time of a frame of one solver [ms], mean of three pieces of a run."""

    unseen: float
    """Where nobody looks before the end: carries are counted, positions between them are not computed."""
    shown: float
    """Where positions are read after each frame."""


def frame_times(
    scenario: str, makers: Mapping[str, Callable[[Scene], MpmSolver]], repeats: int
) -> dict[str, FrameTimes]:
    """Time solvers of the scenario's reference scene, by name, on one thread.

    Counted is the time of the processor, so that others who use the machine add less. Each piece is repeated
    `repeats` times, by turns with those of the others; its lower quartile counts.
    """
    scene = reference_scene(scenario)
    impact = first_impact(MpmSolver(scene), LONGEST_FALL)
    pieces: list[TimedSimulation] = []
    for make in makers.values():
        solver = make(scene)
        for frame in _FROM:
            solver.advance(impact + frame - solver.frame)
            start = solver.snapshot()
            restore = partial(solver.restore, start)
            pieces.append(TimedSimulation(restore=restore, advance=partial(_unseen, solver), frames=_PIECE))
            pieces.append(TimedSimulation(restore=restore, advance=partial(_shown, solver), frames=_PIECE))
    times = [1e3 * spent.seconds for spent in time_per_frame(pieces, repeats)]
    by_solver = np.array(times).reshape(len(makers), len(_FROM), 2).mean(axis=1)
    return {
        name: FrameTimes(unseen=float(unseen), shown=float(shown))
        for name, (unseen, shown) in zip(makers, by_solver, strict=True)
    }


def _unseen(solver: MpmSolver, frames: int) -> float:
    began = time.process_time()
    solver.advance(frames)
    return time.process_time() - began


def _shown(solver: MpmSolver, frames: int) -> float:
    began = time.process_time()
    for _ in range(frames):
        solver.advance(1)
        _ = solver.positions
    return time.process_time() - began

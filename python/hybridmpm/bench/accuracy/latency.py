"""Latency of simulators, call by call and by turns, so that a busy machine is so for all of them."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from hybridmpm.bench.accuracy.impact import LONGEST_FALL, first_impact
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track, warmup_frames
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator

_TURN = 10
"""Frames that a simulator goes on before it is the next one's turn."""
_LEAST_CALLS = 3


@dataclass(frozen=True, kw_only=True)
class Latency:
    """End to end [ms]."""

    median: float
    """Of a frame."""
    p95: float
    """Of a frame."""
    per_call: float
    """Median of a call, which a live session has to wait for."""

    @classmethod
    def of(cls, times: Sequence[float], frames: int) -> Self | None:
        """Take percentiles of calls of so many frames, in seconds; None of too few calls."""
        if len(times) < _LEAST_CALLS:
            return None
        per_frame = 1e3 * np.array(times) / frames
        median = float(np.median(per_frame))
        return cls(median=median, p95=float(np.percentile(per_frame, 95)), per_call=median * frames)


class Timing:
    """A simulator and the times of its calls.

    Parameters
    ----------
    simulator : Simulator
    frames_per_call : int
        r_t: a network computes so many frames at once.
    """

    def __init__(self, simulator: Simulator, frames_per_call: int = 1) -> None:
        self.simulator = simulator
        self._frames = frames_per_call
        self._seconds: list[float] = []
        self._failed = False

    def restart(self, frame: int) -> None:
        """Go to a frame without timing."""
        self.simulator.reset()
        try:
            self.simulator.advance(frame)
        except SimulationError:
            self._failed = True

    def reach(self, frame: int, seconds: float) -> None:
        """Go on to a frame, timing each call, unless `enough`."""
        while self.simulator.frame < frame and not self.enough(seconds):
            began = time.perf_counter()
            try:
                self.simulator.advance(self._frames)
            except SimulationError:
                self._failed = True
            else:
                self._seconds.append(time.perf_counter() - began)

    def enough(self, seconds: float) -> bool:
        """Whether it failed, or has been called often enough and for longer than `seconds`."""
        return self._failed or _enough(self._seconds, seconds)

    def latency(self) -> Latency | None:
        """Percentiles over the calls; None where it failed before there were enough."""
        return Latency.of(self._seconds, self._frames)


def measured(
    timings: Sequence[Timing], *, start: int, span: int, passes: int, seconds: float
) -> list[Latency | None]:
    """Time the calls over some frames of a rollout, by turns.

    Parameters
    ----------
    timings : sequence of Timing
    start, span : int
        Frames: the first is not before the end of any warm-up, `span` many follow.
    passes : int
        How often the rollout is repeated.
    seconds : float
        A simulator that has taken longer than this is left alone from then on.
    """
    for _ in range(passes):
        for timing in timings:
            if not timing.enough(seconds):
                timing.restart(start)
        for stop in range(start + _TURN, start + span + 1, _TURN):
            for timing in timings:
                timing.reach(stop, seconds)
    return [timing.latency() for timing in timings]


def step_latency(
    stepper: Stepper, scene: Scene, *, earliest: int, span: int, threads: int, seconds: float
) -> tuple[Latency | None, Latency | None]:
    """Time single steps of a network on states of MPM, so that their cost does not depend on its weights.

    Parameters
    ----------
    stepper : Stepper
    scene : Scene
    earliest, span : int
        The steps begin, evenly spread, in the `span` frames that follow the first impact, or this frame if
        it is later.
    threads : int
        Of MPM.
    seconds : float
        Time for the steps beyond the first three.

    Returns
    -------
    Of a step with all it takes, the frames within it too, and of MPM with all particles, timed by turns: what
    the machine was worth at that time.
    """
    start = max(earliest, first_impact(MpmSolver(scene), LONGEST_FALL))
    states = record(MpmSolver(scene, r_p=stepper.r_p), start + span)
    yardstick = Timing(MpmSolver(scene, threads=threads))
    yardstick.restart(start)
    _step_seconds(stepper, states, start)
    times: list[float] = []
    for frame in range(start + _TURN, start + span + 1, _TURN):
        yardstick.reach(frame, seconds)
        if not _enough(times, seconds):
            times.append(_step_seconds(stepper, states, frame))
    return Latency.of(times, stepper.r_t), yardstick.latency()


def _step_seconds(stepper: Stepper, states: Recording, frame: int) -> float:
    """Time a network step from a frame of a recording that has each."""
    track = Track(stepper, states.scene, states.types)
    for positions in states.positions[frame - warmup_frames(stepper.r_t) : frame + 1 : stepper.r_t]:
        track.observe(positions)
    began = time.perf_counter()
    track.begin(track.answer())
    for _ in range(stepper.r_t):
        track.tick()
        _ = track.positions
    track.arrive()
    return time.perf_counter() - began


def _enough(times: Sequence[float], seconds: float) -> bool:
    return len(times) >= _LEAST_CALLS and sum(times) > seconds

"""Latency of simulators, call by call and by turns, so that a busy machine is so for all of them."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hybridmpm.errors import SimulationError

_TURN = 10
"""Frames that a simulator goes on before it is the next one's turn."""
_LEAST_CALLS = 3


class Advancing(Protocol):
    """What can be timed."""

    @property
    def frame(self) -> int:
        """Frames done since the start."""

    def advance(self, frames: int = 1) -> None:
        """Go on by whole frames."""

    def reset(self) -> None:
        """Go back to frame 0."""


@dataclass(frozen=True, kw_only=True)
class Latency:
    """End to end [ms]."""

    median: float
    """Of a frame."""
    p95: float
    """Of a frame."""
    per_call: float
    """Median of a call, which a live session has to wait for."""


class Timing:
    """A simulator and the times of its calls.

    Parameters
    ----------
    simulator : Advancing
    frames_per_call : int
        r_t: a network computes so many frames at once.
    """

    def __init__(self, simulator: Advancing, frames_per_call: int = 1) -> None:
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
        return self._failed or (len(self._seconds) >= _LEAST_CALLS and sum(self._seconds) > seconds)

    def latency(self) -> Latency | None:
        """Percentiles over the calls; None where it failed before there were enough."""
        if len(self._seconds) < _LEAST_CALLS:
            return None
        per_frame = 1e3 * np.array(self._seconds) / self._frames
        return Latency(
            median=float(np.median(per_frame)),
            p95=float(np.percentile(per_frame, 95)),
            per_call=float(np.median(per_frame)) * self._frames,
        )


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

"""The timer of all results: many short pieces by turns, so that a busy machine slows down all alike."""

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from hybridmpm_lab.harness.rows import Progress

QUIET = 1.15
"""Slowdown of the machine from which on a time counts as taken under load [-]."""
_NUMBERS = 32_768
"""Numbers per thread of the calibration; they fit into a core's own cache."""
_SWEEPS = 400
"""Sweeps over them in one piece, a few milliseconds."""
_PIECES = 5
"""Pieces of which the quickest counts: a single interruption is no load."""


class Calibration:
    """Fixed arithmetic, whose time shows how busy the machine is beside a measurement.

    Parameters
    ----------
    threads : int
        Threads that work at the same time, each as much as one alone.
    """

    def __init__(self, threads: int) -> None:
        self._numbers = [np.linspace(0.5, 1.5, _NUMBERS, dtype=np.float32) for _ in range(threads)]
        self._least = math.inf
        for _ in range(4):
            self.slowdown()

    def slowdown(self) -> float:
        """Return the time of the arithmetic now over the least time so far, at least 1 [-]."""
        with ThreadPoolExecutor(len(self._numbers)) as pool:
            now = math.inf
            for _ in range(_PIECES):
                start = time.perf_counter()
                list(pool.map(_work, self._numbers))
                now = min(now, time.perf_counter() - start)
        self._least = min(self._least, now)
        return now / self._least


def _work(numbers: np.ndarray) -> None:
    for _ in range(_SWEEPS):
        np.sqrt(numbers, out=numbers)


@dataclass(frozen=True, kw_only=True)
class TimedCall:
    """A call whose time is measured."""

    call: Callable[[], object]
    """The call; it is timed, unless it returns a float: the time by a clock of its own [s]."""
    prepare: Callable[[], object] = lambda: None
    """Called before each measurement, and not timed."""


def seconds_by_turns(
    calls: Sequence[TimedCall], repeats: int, on_progress: Progress | None = None
) -> list[list[float]]:
    """Time each call once a round, and return the times over `repeats` rounds of each call [s].

    One more round comes first: it compiles, and warms the caches up. `on_progress` counts rounds.
    """
    times: list[list[float]] = [[] for _ in calls]
    for index in range(repeats + 1):
        for one, mine in zip(calls, times, strict=True):
            one.prepare()
            start = time.perf_counter()
            own = one.call()
            mine.append(own if isinstance(own, float) else time.perf_counter() - start)
        if index and on_progress is not None:
            on_progress(1)
    return [mine[1:] for mine in times]

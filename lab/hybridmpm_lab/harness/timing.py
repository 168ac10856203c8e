"""Timing several calls by turns, so that what disturbs the machine disturbs all of them alike."""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from hybridmpm_lab.harness.rows import Progress


def _nothing() -> None:
    """Prepare nothing."""


@dataclass(frozen=True, kw_only=True)
class TimedCall:
    """A call whose time is measured."""

    call: Callable[[], object]
    """The call; it is timed, unless it returns a float: the time by a clock of its own [s]."""
    prepare: Callable[[], object] = _nothing
    """Called before each measurement, and not timed."""


@dataclass(frozen=True, kw_only=True)
class TimedSimulation:
    """A simulation that can go back to one state."""

    restore: Callable[[], object]
    """Goes back to the state; not timed."""
    advance: Callable[[int], object]
    """Goes on by a number of frames; timed, unless it returns the time by a clock of its own [s]."""
    frames: int
    """Frames of one measurement."""


class Clock:
    """Adds the time that a block takes to a list [s]; a block that fails is not counted."""

    def __init__(self, times: list[float]) -> None:
        self._times = times

    def __enter__(self) -> None:
        self._began = time.perf_counter()

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is None:
            self._times.append(time.perf_counter() - self._began)


def seconds_by_turns(
    calls: Sequence[TimedCall], repeats: int, on_progress: Progress | None = None
) -> list[list[float]]:
    """Time each call once a round, and return the times over `repeats` rounds of each call [s].

    One more round goes before them: it compiles, and warms the caches up. `on_progress` counts rounds.
    """
    times: list[list[float]] = [[] for _ in calls]
    for index in range(repeats + 1):
        for one, mine in zip(calls, times, strict=True):
            one.prepare()
            began = time.perf_counter()
            own = one.call()
            mine.append(own if isinstance(own, float) else time.perf_counter() - began)
        if index and on_progress is not None:
            on_progress(1)
    return [mine[1:] for mine in times]


@dataclass(frozen=True)
class FrameTime:
    """Time of a frame, from many short pieces of a simulation."""

    seconds: float
    """Lower quartile over the pieces [s]: what disturbs a machine only ever adds time."""
    spread: float
    """Distance from the lower to the upper quartile, over the lower [-]."""


def time_per_frame(simulations: Sequence[TimedSimulation], repeats: int) -> list[FrameTime]:
    """Time simulations by turns, `repeats` pieces of each.

    The first frame after going back is not timed: it touches the memory that the others use.
    """

    def prepare(one: TimedSimulation) -> None:
        one.restore()
        one.advance(1)

    calls = [
        TimedCall(prepare=partial(prepare, one), call=partial(one.advance, one.frames)) for one in simulations
    ]
    times = seconds_by_turns(calls, repeats)
    return [_frame_time(mine, one.frames) for one, mine in zip(simulations, times, strict=True)]


def _frame_time(times: Sequence[float], frames: int) -> FrameTime:
    if len(times) == 1:
        return FrameTime(times[0] / frames, 0.0)
    low, _, high = statistics.quantiles(times, n=4, method="inclusive")
    return FrameTime(low / frames, high / low - 1)

"""Timing several simulations so that what disturbs the machine disturbs all of them."""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Timed:
    """A simulation that can go back to one state."""

    restore: Callable[[], object]
    """Untimed, before each measurement."""
    advance: Callable[[int], object]
    """Timed; takes the number of frames."""
    frames: int
    """In one measurement."""


def seconds_per_frame(simulations: Sequence[Timed], repeats: int) -> list[float]:
    """Measure them by turns, and return the median over `repeats` rounds of each [s]."""
    times: list[list[float]] = [[] for _ in simulations]
    for _ in range(repeats + 1):
        for simulation, mine in zip(simulations, times, strict=True):
            simulation.restore()
            began = time.perf_counter()
            simulation.advance(simulation.frames)
            mine.append((time.perf_counter() - began) / simulation.frames)
    # The first round compiles, and warms the caches up.
    return [statistics.median(mine[1:]) for mine in times]

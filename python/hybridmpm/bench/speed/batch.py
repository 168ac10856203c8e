"""Throughput of `MpmBatch`: the same scenes on one thread and on several."""

import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hybridmpm import scenarios
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.mpm import MpmBatch

_RUN_UP = 120
"""Frames before the measurement: most bodies have hit the floor by then and are spreading."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Size and length of the measurement."""

    scenario: str = "water_2d"
    scenes: int = 16
    """Of the seeds from 0 on."""
    threads: int = 2
    """Compared with one."""
    frames: int = 10
    """Timed in one go."""
    repeats: int = 9
    """The least time over these is reported: what a busy machine adds is not the batch's."""


def rows(
    settings: Settings, source: Provenance, *, on_progress: Callable[[int], object] | None = None
) -> list[dict[str, Any]]:
    """Measure and return a row for one thread and one for several.

    `on_progress` is called with the repeats done since its last call.
    """
    scenes = [scenarios.get(settings.scenario, seed) for seed in range(settings.scenes)]
    batches = {threads: MpmBatch(scenes, threads=threads) for threads in (1, settings.threads)}
    for batch in batches.values():
        batch.advance(_RUN_UP)
    starts = [member.snapshot() for member in batches[1]]
    seconds = dict.fromkeys(batches, math.inf)
    # In turns, so that what else the machine does in the meantime slows down both.
    for _ in range(settings.repeats):
        for threads, batch in batches.items():
            seconds[threads] = min(seconds[threads], _seconds(batch, starts, settings.frames))
        if on_progress is not None:
            on_progress(1)
    total = settings.scenes * settings.frames
    return [
        {
            "scenario": settings.scenario,
            "scenes": settings.scenes,
            "particles": sum(member.particle_count for member in batch),
            "threads": threads,
            "ms_per_scene_frame": round(1e3 * seconds[threads] / total, 4),
            "frames_per_second": round(total / seconds[threads], 1),
            "speedup": round(seconds[1] / seconds[threads], 3),
            **dataclasses.asdict(source),
        }
        for threads, batch in batches.items()
    ]


def _seconds(batch: MpmBatch, starts: list[bytes], frames: int) -> float:
    """Time the same frames as ever."""
    for member, start in zip(batch, starts, strict=True):
        member.restore(start)
    began = time.perf_counter()
    batch.advance(frames)
    return time.perf_counter() - began

"""Throughput of `MpmBatch`: the same scenes on one thread and on several."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from hybridmpm import scenarios
from hybridmpm.mpm import MpmBatch
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns

_RUN_UP = 120
"""Frames before the measurement: most bodies have hit the floor by then and are spreading."""


@dataclass(frozen=True, kw_only=True)
class BatchSettings:
    """Size and length of the measurement."""

    scenario: str = "water_2d"
    """Scenario of the scenes."""
    scenes: tuple[int, ...] = (16,)
    """Numbers of scenes; their seeds are 0 and following."""
    threads: int = 2
    """Number of threads that one thread is compared with."""
    frames: int = 10
    """Number of frames timed in one go."""
    repeats: int = 9
    """Number of timings of each batch, the least of which is reported: a busy machine only adds to it."""


def measure(settings: BatchSettings, on_progress: Progress) -> Iterator[Row]:
    """Time each batch and yield a row for one thread and one for several; `on_progress` counts repeats."""
    for count in settings.scenes:
        yield from _measured(settings, count, on_progress)


def _measured(settings: BatchSettings, count: int, on_progress: Progress) -> Iterator[Row]:
    scenes = [scenarios.get(settings.scenario, seed) for seed in range(count)]
    batches = {threads: MpmBatch(scenes, threads=threads) for threads in (1, settings.threads)}
    several = batches[settings.threads]
    several.advance(_RUN_UP)
    starts = [member.snapshot() for member in several]
    calls = [
        TimedCall(prepare=partial(_restore, batch, starts), call=partial(batch.advance, settings.frames))
        for batch in batches.values()
    ]
    times = seconds_by_turns(calls, settings.repeats, on_progress)
    seconds = dict(zip(batches, map(min, times), strict=True))
    total = count * settings.frames
    for threads, batch in batches.items():
        yield {
            "scenario": settings.scenario,
            "scenes": count,
            "particles": sum(member.particle_count for member in batch),
            "threads": threads,
            "ms_per_scene_frame": round(1e3 * seconds[threads] / total, 4),
            "frames_per_second": round(total / seconds[threads], 1),
            "speedup": round(seconds[1] / seconds[threads], 3),
        }


def _restore(batch: MpmBatch, starts: Sequence[bytes]) -> None:
    for member, start in zip(batch, starts, strict=True):
        member.restore(start)

"""Throughput of `MpmBatch`: the same scenes on one thread and on several."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

from hybridmpm import scenarios
from hybridmpm.mpm import MpmBatch
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns

_RUN_UP = 120
"""Frames before the measurement: most bodies have hit the floor by then and are spreading."""


class Settings(NamedTuple):
    """Size and length of the measurement."""

    scenario: str
    counts: Sequence[int]
    """Numbers of scenes, of the seeds 0 and following."""
    threads: int
    """Number of threads that one thread is compared with."""
    frames: int
    """Number of frames timed in one go."""
    repeats: int
    """Number of timings, the least of which counts: a busy machine only adds to it."""


def measure(settings: Settings, on_progress: Progress) -> Iterator[Row]:
    """Time each batch and yield a row for one thread and one for several; `on_progress` counts repeats."""
    scenario, counts, threads, frames, repeats = settings
    for count in counts:
        scenes = [scenarios.get(scenario, seed) for seed in range(count)]
        batches = {each: MpmBatch(scenes, threads=each) for each in (1, threads)}
        batches[threads].advance(_RUN_UP)
        starts = [member.snapshot() for member in batches[threads]]
        calls = [
            TimedCall(prepare=partial(_restore, batch, starts), call=partial(batch.advance, frames))
            for batch in batches.values()
        ]
        seconds = [min(mine) for mine in seconds_by_turns(calls, repeats, on_progress)]
        for (each, batch), mine in zip(batches.items(), seconds, strict=True):
            yield {
                "scenario": scenario,
                "scenes": count,
                "particles": sum(member.particle_count for member in batch),
                "threads": each,
                "ms_per_scene_frame": round(1e3 * mine / (count * frames), 4),
                "frames_per_second": round(count * frames / mine, 1),
                "speedup": round(seconds[0] / mine, 3),
            }


def _restore(batch: MpmBatch, starts: Sequence[bytes]) -> None:
    for member, start in zip(batch, starts, strict=True):
        member.restore(start)

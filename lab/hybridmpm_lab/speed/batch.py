"""Throughput of `MpmBatch`: the same scenes on one thread and on several."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from hybridmpm import scenarios
from hybridmpm.mpm import MpmBatch
from hybridmpm_lab.harness.command import Measurement, measured, setting
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns

_RUN_UP = 120  # frames before the measurement: most bodies have hit the floor by then and are spreading


@dataclass(frozen=True, kw_only=True)
class BatchSettings:
    """Size and length of the measurement."""

    scenario: str = setting("water_2d", "Scenario of the scenes.", scenarios.NAMES)
    scenes: tuple[int, ...] = setting(
        (16,), "Number of scenes, of the seeds 0 and following.", low=1, high=4096
    )
    threads: int = setting(2, "Number of threads that one thread is compared with.", low=2, high=1024)
    frames: int = setting(10, "Number of frames timed in one go.", low=1, high=1000)
    repeats: int = setting(9, "Number of timings, the least of which counts.", low=1, high=1000)

    @property
    def steps(self) -> int:
        """Number of rounds."""
        return self.repeats * len(self.scenes)


def measure(settings: BatchSettings, on_progress: Progress) -> Iterator[Row]:
    """Time each batch and yield a row for one thread and one for several; `on_progress` counts rounds."""
    threads, frames = settings.threads, settings.frames
    for count in settings.scenes:
        scenes = [scenarios.get(settings.scenario, seed) for seed in range(count)]
        batches = {each: MpmBatch(scenes, threads=each) for each in (1, threads)}
        batches[threads].advance(_RUN_UP)
        starts = [member.snapshot() for member in batches[threads]]
        calls = [
            TimedCall(prepare=partial(_restore, batch, starts), call=partial(batch.advance, frames))
            for batch in batches.values()
        ]
        seconds = [min(mine) for mine in seconds_by_turns(calls, settings.repeats, on_progress)]
        for (each, batch), mine in zip(batches.items(), seconds, strict=True):
            yield {
                "scenario": settings.scenario,
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


batch = Measurement(
    name="batch",
    settings=BatchSettings,
    measure=measured(measure),
    columns=(
        "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second", "speedup",
    ),
    summary="""Time many scenes on one thread and on several, in the middle of their splash.""",
).command()  # fmt: skip

"""Data sets as jobs: trajectories of a scenario, made one after the other and packed into one file."""

import asyncio
import threading
import zipfile
from collections.abc import Generator, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from hybridmpm.data import Recipe, Seeds, generate, plan
from hybridmpm.data.generation.executors import Outcome, produce
from hybridmpm_service.jobs.job import Progress, Result

MEDIA_TYPE = "application/zip"


class _OneByOne:
    """Makes one trajectory at a time, in the thread that asks; ends within some frames once `stop` is set."""

    def __init__(self, stop: threading.Event) -> None:
        self._stop = stop

    def run(self, recipe: Recipe, seeds: Iterable[int]) -> Generator[Outcome]:
        """Yield the outcome of each seed."""
        for seed in seeds:
            yield produce(recipe, seed, self._stop)


async def made(
    pool: ThreadPoolExecutor, recipe: Recipe, seeds: Seeds, progress: Progress, folder: Path
) -> Result:
    """Make a data set in a thread of the pool, and return a zip file of its splits and metadata.

    Cancelled, it ends within some frames. Raises as `hybridmpm.data.generate`.
    """
    stop, total = threading.Event(), sum(seeds.counts().values())
    progress.tell(0, total)

    def note(count: int) -> None:
        progress.tell(progress.done + count, total)

    def make() -> Path:
        planned = plan(recipe, folder / recipe.name, seeds)
        generate(planned, executor=_OneByOne(stop), on_progress=note)
        packed = folder / f"{recipe.name}.zip"
        # What compresses has been compressed.
        with zipfile.ZipFile(packed, "w") as file:
            for part in sorted(planned.folder.iterdir()):
                if part.suffix in {".h5", ".json"}:
                    file.write(part, f"{recipe.name}/{part.name}")
        return packed

    making = asyncio.get_running_loop().run_in_executor(pool, make)
    try:
        file = await asyncio.shield(making)
    except asyncio.CancelledError:
        stop.set()
        # The folder goes with the job, so nobody may be writing to it any more.
        await asyncio.gather(making, return_exceptions=True)
        raise
    return Result(file=file, media_type=MEDIA_TYPE)

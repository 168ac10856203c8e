"""Jobs: work in the background with progress, an end and a file."""

import asyncio
import contextlib
import logging
import os
import shutil
import sqlite3
import tempfile
import threading
import zipfile
from collections import Counter
from collections.abc import Awaitable, Callable, Generator, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from hybridmpm.data import Outcome, Recipe, Seeds, generate, plan, produce
from hybridmpm.errors import SimulationError
from hybridmpm_service.errors import JobLostError, JobNotFoundError, ServiceError, TooManyJobsError
from hybridmpm_service.keys.callers import CALLER, Quotas
from hybridmpm_service.sessions import names
from hybridmpm_service.sessions.journal import locked
from hybridmpm_service.sessions.player import Clock
from hybridmpm_service.sessions.turns import Turn, Turns

_log = logging.getLogger(__name__)

_FOLDERS = "hybridmpm-jobs-"
"""Start of the names of temporary folders with the files of jobs."""

Kind = Literal["trajectory", "recording", "dataset"]
Phase = Literal["running", "done", "failed"]


class Progress:
    """Progress of a job. Written by the thread that works, read by the event loop."""

    def __init__(self) -> None:
        self.done = 0
        """Number of frames, or of other parts, that are done."""
        self.total: int | None = None
        """Number of all of them; None until it is known."""

    def update(self, done: int, total: int) -> None:
        """Set the number of parts that are done, and that of all."""
        self.done, self.total = done, total


@dataclass(frozen=True, kw_only=True)
class Result:
    """File that a job has made."""

    file: Path
    media_type: str


Work: TypeAlias = Callable[[Progress, Path], Awaitable[Result]]
"""Writes the result to a folder; cancelled, it ends soon."""


class Job:
    """Running or ended work in the background. Belongs to the event loop.

    Parameters
    ----------
    kind : str
        Kind of its result.
    session : str or None
        Name of its session; None for a data set.
    work : callable
    folder : Path
        Parent of the folder for its files; it need not exist.
    clock : callable
        Returns the time [s].
    run : str
        Start of its name.
    """

    def __init__(
        self,
        kind: Kind,
        session: str | None,
        work: Work,
        folder: Path,
        clock: Callable[[], float],
        *,
        run: str,
    ) -> None:
        self.id, self.owner = names.new(run), CALLER.get().owner
        self.kind = kind
        self.session = session
        self.progress = Progress()
        self.ended_at: float | None = None
        """Time of its end, by the clock; None before."""
        self.error: Exception | None = None
        """Reason of its failure."""
        self.result: Result | None = None
        self.folder = folder / self.id
        self._clock = clock
        self._task = asyncio.create_task(self._run(work))

    @property
    def phase(self) -> Phase:
        """Phase of the work."""
        if self.ended_at is None:
            return "running"
        return "done" if self.result is not None else "failed"

    async def cancel(self) -> None:
        """End the work, and wait until it has ended."""
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def _run(self, work: Work) -> None:
        try:
            await asyncio.to_thread(self.folder.mkdir, parents=True)
            self.result = await work(self.progress, self.folder)
        except Exception as error:  # noqa: BLE001 - raised again to those who fetch the result
            self.error = error
            if not isinstance(error, ServiceError | SimulationError):
                # A fault of the service: its text is for the log alone.
                _log.exception("job %s failed", self.id)
        finally:
            self.ended_at = self._clock()


class JobTable:
    """The running jobs, and those whose results are kept. Belongs to the event loop.

    Results are stored in a temporary folder, which is deleted with the service. Folders that killed processes
    left behind are deleted at the start.

    Parameters
    ----------
    most : int
        Largest number of jobs, those that have ended among them.
    keep_seconds : float
        Time for which a job is kept after its end [s].
    clock : Clock
    node : str
        Name of this node of several, or nothing.
    quotas : Quotas, optional
        Quotas of keys; none if absent.

    Attributes
    ----------
    run : str
        Start of the ids of all jobs of this run of the service; those of earlier ones are lost.
    """

    def __init__(
        self, most: int, keep_seconds: float, clock: Clock, node: str = "", quotas: Quotas | None = None
    ) -> None:
        self._node, self.run = node, names.new(node)[:8]
        self._most, self._keep_seconds, self._clock = most, keep_seconds, clock
        self._quotas = quotas or Quotas()
        self._quotas.stored.append(self._stored)
        self._jobs: dict[str, Job] = {}
        self._folder: Path | None = None
        self._lock: sqlite3.Connection | None = None
        for folder in Path(tempfile.gettempdir()).glob(f"{_FOLDERS}*"):
            if _is_left_behind(folder):
                shutil.rmtree(folder, ignore_errors=True)

    def begin(self, kind: Kind, session: str | None, work: Work) -> Job:
        """Begin a job of the caller.

        Where the table or the quota of the caller is full, a job that has ended is forgotten: the first of
        the caller, else of the key that has most.

        Raises
        ------
        TooManyJobsError
            The allowed number of jobs runs already.
        QuotaError
            The jobs of the caller take as much as they may.
        """
        owner = CALLER.get().owner
        counts = Counter(job.owner for job in self._jobs.values())
        most = self._quotas.of(owner).jobs
        own_full = most is not None and counts[owner] >= most
        if own_full or len(self._jobs) >= self._most:
            ended = [job for job in self._jobs.values() if job.ended_at is not None]
            own = [job for job in ended if job.owner == owner]
            if own_full and not own:
                self._quotas.check_number(owner, counts[owner], "jobs")
            if not ended:
                raise TooManyJobsError(
                    f"{len(self._jobs)} jobs run, and no more are allowed: wait for one to end, or delete one"
                )
            self._forget(min(own or ended, key=lambda job: (-counts[job.owner], job.ended_at or 0.0)))
        self._quotas.check_bytes(owner)
        if self._folder is None:
            new = Path(tempfile.mkdtemp(prefix="hybridmpm-new-"))
            self._lock = locked(new)
            # Under its name it is locked from the first moment, so that no other process deletes it.
            self._folder = new.rename(new.with_name(new.name.replace("hybridmpm-new-", _FOLDERS)))
        job = Job(kind, session, work, self._folder, self._clock, run=self.run)
        self._jobs[job.id] = job
        return job

    def get(self, name: str) -> Job:
        """Return a job.

        Raises
        ------
        OtherNodeError
            It is of another node.
        JobLostError
            It is not of this run of the service.
        JobNotFoundError
            There is none of this name.
        """
        job = self._jobs.get(name)
        if job is not None and not CALLER.get().sees(job):
            job = None
        if job is None:
            names.check_node(name, self._node)
        if job is None and names.PATTERN.fullmatch(name) and not name.startswith(self.run):
            raise JobLostError(
                f"job {name!r} is not of the present run of the service: it and its result were lost when an "
                "earlier run ended. Begin it again"
            )
        if job is None:
            raise JobNotFoundError(
                f"there is no job {name[:64]!r}; it may have been deleted, or have ended more than "
                f"{self._keep_seconds:g} s ago"
            )
        return job

    def visible(self) -> list[Job]:
        """Return the jobs that the caller sees, the oldest first."""
        caller = CALLER.get()
        return [job for job in self.all() if caller.sees(job)]

    def _stored(self, owner: str) -> int:
        """Return the size of the files of a key's jobs [bytes]."""
        files = (file for job in self.all() if job.owner == owner for file in job.folder.rglob("*"))
        return sum(file.stat().st_size for file in files if file.is_file())

    def all(self) -> list[Job]:
        """Return all jobs, the oldest first."""
        return list(self._jobs.values())

    async def delete(self, name: str) -> None:
        """End a job and forget it; errors as `get`."""
        job = self.get(name)
        await job.cancel()
        self._forget(job)

    def expire(self) -> None:
        """Forget the jobs that ended long ago."""
        latest = self._clock() - self._keep_seconds
        for job in self.all():
            if job.ended_at is not None and job.ended_at < latest:
                self._forget(job)

    async def close(self) -> None:
        """End all jobs, and delete their files."""
        await asyncio.gather(*(job.cancel() for job in self.all()))
        self._jobs.clear()
        if self._folder is not None and self._lock is not None:
            await asyncio.to_thread(shutil.rmtree, self._folder, ignore_errors=True)
            self._lock.close()

    def _forget(self, job: Job) -> None:
        with contextlib.suppress(KeyError):
            del self._jobs[job.id]
        shutil.rmtree(job.folder, ignore_errors=True)


def _is_left_behind(folder: Path) -> bool:
    """Whether a folder of jobs is of this user, and of a process that has ended."""
    try:
        if folder.is_symlink() or folder.stat().st_uid != (os.getuid() if hasattr(os, "getuid") else 0):
            return False
        locked(folder).close()
    except (OSError, sqlite3.Error):
        return False
    return True


MEDIA_TYPE = "application/zip"


class _Stop(threading.Event):
    """Event that is set once a turn has ended; whoever reads it waits for the turn."""

    def __init__(self, turn: Turn) -> None:
        super().__init__()
        self._turn = turn

    def is_set(self) -> bool:
        """Wait for the turn; return whether it has ended. Called between frames."""
        self._turn.wait()
        return self._turn.flag.is_set


class _OneByOne:
    """Executor of one trajectory at a time, in the calling thread; it ends within some frames of `stop`."""

    def __init__(self, stop: threading.Event) -> None:
        self._stop = stop

    def run(self, recipe: Recipe, seeds: Iterable[int]) -> Generator[Outcome]:
        """Yield the outcome of each seed."""
        for seed in seeds:
            yield produce(recipe, seed, self._stop)


async def made(
    turns: Turns, recipe: Recipe, seeds: Seeds, progress: Progress, folder: Path, *, memory: int
) -> Result:
    """Make a data set in a turn, and return a zip file of its splits and metadata.

    Its trajectories are made and written one by one; each takes some `memory` [bytes]. Cancelled, it ends
    within some frames. Raises as `hybridmpm.data.generate`.
    """
    total = sum(seeds.counts().values())
    progress.update(0, total)

    def note(count: int) -> None:
        progress.update(progress.done + count, total)

    def make(turn: Turn) -> Path:
        planned = plan(recipe, folder / recipe.name, seeds)
        generate(planned, executor=_OneByOne(_Stop(turn)), on_progress=note)
        packed = folder / f"{recipe.name}.zip"
        # HDF5 files are compressed already.
        with zipfile.ZipFile(packed, "w") as file:
            for part in sorted(planned.folder.iterdir()):
                turn.check()
                if part.suffix in {".h5", ".json"}:
                    file.write(part, f"{recipe.name}/{part.name}")
        return packed

    async with turns.turn(memory=memory, background=True) as turn:
        return Result(file=await turn.in_thread(lambda: make(turn)), media_type=MEDIA_TYPE)

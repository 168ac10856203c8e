"""The jobs of a service."""

import asyncio
import contextlib
import shutil
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from hybridmpm_service.errors import JobNotFoundError, TooManyJobsError
from hybridmpm_service.jobs.job import Job, Kind, Work
from hybridmpm_service.sessions.playing.pace import Clock


class JobTable:
    """The jobs that run, and those whose results wait to be fetched. Belongs to the event loop.

    Results lie in a folder of the system for temporary files, which goes with the service.

    Parameters
    ----------
    most : int
        Largest number of jobs, those that have ended among them.
    keep_seconds : float
        Time for which a job is kept after its end [s].
    clock : Clock

    Attributes
    ----------
    pool : ThreadPoolExecutor
        The one thread of the jobs that belong to no session.
    """

    def __init__(self, most: int, keep_seconds: float, clock: Clock) -> None:
        self._most, self._keep_seconds, self._clock = most, keep_seconds, clock
        self._jobs: dict[str, Job] = {}
        self._folder: Path | None = None
        self.pool = ThreadPoolExecutor(1, "jobs")

    def begin(self, kind: Kind, session: str | None, work: Work) -> Job:
        """Begin with a job; the one that ended first makes room for it.

        Raises
        ------
        TooManyJobsError
            As many jobs as are allowed still run.
        """
        if len(self._jobs) >= self._most:
            ended = [job for job in self._jobs.values() if job.ended_at is not None]
            if not ended:
                raise TooManyJobsError(
                    f"{len(self._jobs)} jobs run, and no more are allowed: wait for one to end, or delete one"
                )
            self._forget(min(ended, key=lambda job: job.ended_at or 0.0))
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="hybridmpm-jobs-"))
        job = Job(kind, session, work, self._folder, self._clock)
        self._jobs[job.id] = job
        return job

    def get(self, name: str) -> Job:
        """Return a job.

        Raises
        ------
        JobNotFoundError
            There is none of this name.
        """
        job = self._jobs.get(name)
        if job is None:
            raise JobNotFoundError(
                f"there is no job {name!r}; it may have been deleted, have ended more than "
                f"{self._keep_seconds:g} s ago, or have been lost when the service was started anew"
            )
        return job

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
        self.pool.shutdown(wait=False)
        if self._folder is not None:
            await asyncio.to_thread(shutil.rmtree, self._folder, ignore_errors=True)

    def _forget(self, job: Job) -> None:
        with contextlib.suppress(KeyError):
            del self._jobs[job.id]
        shutil.rmtree(job.folder, ignore_errors=True)

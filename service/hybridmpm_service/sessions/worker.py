"""A thread that runs jobs for the event loop, one after the other."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from hybridmpm_service.errors import SessionBusyError

MAX_WAITING = 32
"""Largest number of jobs that may wait for one thread of a session."""

T = TypeVar("T")


class Worker:
    """A thread of a session; it starts with the first job. Belongs to the event loop.

    Parameters
    ----------
    purpose : str
        What it is for, as a part of the thread's name.
    session : str
        Name of the session.
    check_open : callable
        Called before and after each job; it raises once the session is closed.
    """

    def __init__(self, purpose: str, session: str, check_open: Callable[[], None]) -> None:
        self._session = session
        self._check_open = check_open
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"{purpose}-{session[:8]}")
        self._waiting = 0
        self._queued: set[object] = set()

    @property
    def in_demand(self) -> bool:
        """Whether a job waits that does not run yet. Safe to ask from the thread."""
        return bool(self._queued)

    async def run(self, job: Callable[[], T]) -> T:
        """Run a job after those that wait; return its result.

        Raises
        ------
        SessionBusyError
            Too many jobs wait.
        SessionNotFoundError
            The session was closed.
        """
        if self._waiting >= MAX_WAITING:
            raise SessionBusyError(f"{MAX_WAITING} calls already wait for session {self._session!r}")
        self._check_open()

        place = object()

        def checked() -> T:
            self._queued.discard(place)
            self._check_open()
            result = job()
            self._check_open()
            return result

        self._waiting += 1
        self._queued.add(place)
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, checked)
        finally:
            self._waiting -= 1
            self._queued.discard(place)

    def end(self) -> None:
        """Take no more jobs; those that were taken are still run."""
        self._thread.shutdown(wait=False)

    async def ended(self) -> None:
        """Wait until the jobs that were taken before `end` have been run."""
        await asyncio.to_thread(self._thread.shutdown, wait=True)

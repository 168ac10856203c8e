"""A thread that runs jobs for the event loop, one after the other."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

from hybridmpm_service.errors import SessionBusyError

MAX_WAITING = 32
"""Largest number of jobs that may wait for one thread of a session."""

T = TypeVar("T")


class Worker:
    """A thread of a session; it starts with the first job. Belongs to the event loop.

    Parameters
    ----------
    purpose : str
        Purpose, as a part of the thread's name.
    session : str
        Name of the session.
    check_open : callable
        Called before and after each job; it raises once the session is closed.
    """

    def __init__(self, purpose: str, session: str, check_open: Callable[[], None]) -> None:
        self._session = session
        self._check_open = check_open
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"{purpose}-{session[:8]}")
        self._unfinished: set[Future[Any]] = set()
        self._queued: set[object] = set()

    @property
    def in_demand(self) -> bool:
        """Whether a job waits that does not run yet. Safe to read from the thread."""
        return bool(self._queued)

    async def run(self, job: Callable[[], T]) -> T:
        """Run a job after those that wait; return its result.

        A cancelled call removes a job that waits. One that runs already is run to its end.

        Raises
        ------
        SessionBusyError
            Too many jobs wait.
        SessionNotFoundError
            The session was closed.
        """
        if len(self._unfinished) >= MAX_WAITING:
            raise SessionBusyError(f"{MAX_WAITING} calls already wait for session {self._session!r}")
        self._check_open()

        place = object()

        def checked() -> T:
            self._queued.discard(place)
            self._check_open()
            try:
                return job()
            finally:
                # A closed session takes precedence over any other outcome.
                self._check_open()

        self._queued.add(place)
        future = self._thread.submit(checked)
        self._unfinished.add(future)
        future.add_done_callback(self._unfinished.discard)
        try:
            return await asyncio.wrap_future(future)
        finally:
            self._queued.discard(place)

    def end(self, last: Callable[[], object] | None = None) -> None:
        """Take no more jobs; run those that were taken, and then the `last` one."""
        if last is not None:
            future = self._thread.submit(last)
            self._unfinished.add(future)
            future.add_done_callback(self._unfinished.discard)
        self._thread.shutdown(wait=False)

    async def ended(self) -> None:
        """Wait until the jobs that were taken before `end` have been run."""
        unfinished = [asyncio.wrap_future(future) for future in list(self._unfinished)]
        await asyncio.gather(*unfinished, return_exceptions=True)
        # Nothing is left to wait for but the thread's last instructions.
        self._thread.shutdown(wait=True)

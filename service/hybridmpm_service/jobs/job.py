"""One job: work in the background with progress, an end and a file."""

import asyncio
import logging
import uuid
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from hybridmpm.errors import SimulationError
from hybridmpm_service.errors import ServiceError

_log = logging.getLogger(__name__)

Kind = Literal["trajectory", "recording", "dataset"]
Phase = Literal["running", "done", "failed"]


class Progress:
    """How far a job is. Written by the thread that works, read by the event loop."""

    def __init__(self) -> None:
        self.done = 0
        """Number of frames, or of other parts, that are done."""
        self.total: int | None = None
        """Number of all of them; None until it is known."""

    def tell(self, done: int, total: int) -> None:
        """Note how many parts are done, and how many there are."""
        self.done, self.total = done, total


@dataclass(frozen=True, kw_only=True)
class Result:
    """What a job has made."""

    file: Path
    media_type: str


Work: TypeAlias = Callable[[Progress, Path], Awaitable[Result]]
"""Works until the result lies in a folder; cancelled, it ends soon."""


class Job:
    """Work in the background, which has begun. Belongs to the event loop.

    Parameters
    ----------
    kind : str
        What it makes.
    session : str or None
        Name of the session that it is of; None of a job that belongs to none.
    work : callable
    folder : Path
        Where its files may lie; it need not exist.
    clock : callable
        Tells the time [s].
    """

    def __init__(
        self, kind: Kind, session: str | None, work: Work, folder: Path, clock: Callable[[], float]
    ) -> None:
        self.id = uuid.uuid4().hex
        self.kind = kind
        self.session = session
        self.progress = Progress()
        self.ended_at: float | None = None
        """When it ended, by the clock; None before."""
        self.error: Exception | None = None
        """Why it failed."""
        self.result: Result | None = None
        self.folder = folder / self.id
        self._clock = clock
        self._task = asyncio.create_task(self._run(work))

    @property
    def phase(self) -> Phase:
        """How far it is."""
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
        except Exception as error:  # noqa: BLE001 - whoever asks for the result is told
            self.error = error
            if not isinstance(error, ServiceError | SimulationError):
                # A fault of ours, which nobody but the log may see.
                _log.exception("job %s failed", self.id)
        finally:
            self.ended_at = self._clock()

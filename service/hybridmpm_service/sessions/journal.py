"""Journal: all inputs of a simulation since frame 0, in memory and, where there is a file, on disk."""

import logging
import time
from collections.abc import Callable, Iterable
from typing import Literal, TypeAlias

from hybridmpm_service.errors import StorageError
from hybridmpm_service.sessions.inputs import Input
from hybridmpm_service.sessions.storage import Checkpoint, SessionFile

MAX_INPUTS = 50_000
"""Largest number of inputs that are kept; a hand that moves in every frame for eight minutes at a quarter of
real time makes as many."""
CHECKPOINT_SECONDS = 1.0
"""Time of computing between two checkpoints [s]: the most that a restart computes again."""
_RETRY_SECONDS = 5.0
"""Time from a failed write to the next attempt [s]."""

Kept: TypeAlias = Literal["memory", "disk", "failing"]
"""Storage of a session. failing: its file cannot be written at present."""

_log = logging.getLogger(__name__)


class Journal:
    """All inputs of a simulation since frame 0. Used by the thread of its session.

    A file that cannot be written stops nothing: the session goes on in memory, `kept` is "failing", and some
    seconds later the whole journal is written again.

    Parameters
    ----------
    inputs : iterable of Input, optional
        Those that have acted already.
    complete : bool
        Whether they are all since frame 0.
    """

    def __init__(self, inputs: Iterable[Input] = (), *, complete: bool = True) -> None:
        self._inputs = list(inputs)
        self._complete = complete
        self._file: SessionFile | None = None
        self._kept: Kept = "memory"
        self._failed_at = 0.0
        self._checked_at = 0.0

    @property
    def kept(self) -> Kept:
        """Storage of the session. Safe to read from any thread."""
        return self._kept

    @property
    def inputs(self) -> tuple[Input, ...] | None:
        """All inputs in the order in which they acted; None where there were more than `MAX_INPUTS`."""
        return tuple(self._inputs) if self._complete else None

    def fork(self) -> "Journal":
        """Return a journal of a copy of the simulation, without a file."""
        return Journal(self._inputs, complete=self._complete)

    def keep_in(self, file: SessionFile, computed_seconds: float = 0.0) -> None:
        """Write to a file from now on, which has the present inputs already."""
        self._file, self._kept, self._checked_at = file, "disk", computed_seconds

    def add(self, made: Input, guidance: Callable[[], bytes] | None = None) -> None:
        """Note an input before it acts; of a sketch, `guidance` returns a snapshot of its guidance."""
        if len(self._inputs) == MAX_INPUTS:
            self._inputs.clear()
            self._complete = False
            self._write(lambda file: file.overflow())
        if self._complete:
            self._inputs.append(made)
        self._write(lambda file: file.append(made, None if guidance is None else guidance()))

    def clear(self) -> None:
        """Forget all inputs: the simulation is at frame 0 again."""
        self._inputs.clear()
        self._complete = True
        self._write(lambda file: file.clear())

    def mark(self, frame: int) -> None:
        """Note the frame that an answer reports to a client."""
        self._write(lambda file: file.mark(frame))

    def settle(self, computed_seconds: float, checkpoint: Callable[[], Checkpoint]) -> None:
        """Write a checkpoint if one is due, or everything if an earlier write failed."""
        if self._file is None:
            return
        if self._kept == "failing":
            if time.monotonic() - self._failed_at > _RETRY_SECONDS:
                self.check(computed_seconds, checkpoint)
        elif computed_seconds - self._checked_at > CHECKPOINT_SECONDS:
            self.check(computed_seconds, checkpoint)

    def check(self, computed_seconds: float, checkpoint: Callable[[], Checkpoint]) -> None:
        """Write a checkpoint now, and everything else if an earlier write failed."""
        if self._file is None:
            return
        state = checkpoint()
        if self._kept == "failing":
            self._kept = "disk"
            self._write(lambda file: file.rewrite(self._inputs, state, complete=self._complete))
        else:
            self._write(lambda file: file.check(state))
        self._checked_at = computed_seconds

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def discard(self) -> None:
        """Delete the file; nothing more is kept. It may still be in use by the session's thread."""
        if self._file is not None:
            self._file.remove()

    def _write(self, write: Callable[[SessionFile], None]) -> None:
        if self._file is None or self._kept == "failing":
            return
        try:
            write(self._file)
        except StorageError as err:
            _log.warning("a session is kept in memory alone: %s", err)
            self._kept, self._failed_at = "failing", time.monotonic()

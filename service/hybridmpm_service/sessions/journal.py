"""Sessions on disk: a folder with a file for each, and the journal of inputs that a session writes to it."""

import contextlib
import logging
import math
import sqlite3
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from hybridmpm.errors import ConfigError
from hybridmpm_service.errors import StorageError
from hybridmpm_service.sessions import names
from hybridmpm_service.sessions.inputs import Input, Inputs, Origin, SketchInput
from hybridmpm_service.sessions.session_file import PART_SUFFIX, Checkpoint, SessionFile, remove, start_of

_SUFFIX = ".session"


def locked(folder: Path) -> sqlite3.Connection:
    """Return a lock on a folder, which the system releases when the process ends, in any way.

    Raises
    ------
    sqlite3.Error
        Another process has it, or the folder cannot be written.
    """
    # A program may build the application in one thread, and end it in another.
    lock = sqlite3.connect(folder / "lock", timeout=0, isolation_level=None, check_same_thread=False)
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except BaseException:
        lock.close()
        raise
    return lock


class Folder:
    """A folder with a file for each session, which one service at a time may use.

    Parameters
    ----------
    path : Path
        Made if it does not exist.

    Raises
    ------
    ConfigError
        The folder cannot be written, or another service uses it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = locked(path)
        except (sqlite3.Error, OSError) as err:
            raise ConfigError(
                f"state_folder: {path} cannot be used: {err}. It must be a folder that the service may "
                "write, and that no other service uses"
            ) from None
        # A killed process was creating them, and nobody got an answer.
        for part in path.glob(f"*{PART_SUFFIX}"):
            if names.PATTERN.fullmatch(part.stem):
                with contextlib.suppress(OSError):
                    remove(part)

    def names(self) -> dict[str, str]:
        """Return the owner of each session that has a file, by its name, in the order in which they began."""
        files = [path for path in self._path.glob(f"*{_SUFFIX}") if names.PATTERN.fullmatch(path.stem)]
        starts = {path: start_of(path) for path in files if path.is_file()}
        return {
            path.stem: starts[path][1]
            for path in sorted(starts, key=lambda path: (starts[path][0], path.stem))
        }

    def path(self, name: str) -> Path:
        """Return the path of a session's file."""
        return self._path / f"{name}{_SUFFIX}"

    def close(self) -> None:
        """Let another service use the folder."""
        self._lock.close()


MAX_INPUTS = 50_000
"""Largest number of inputs that are kept; a hand that moves in every frame for eight minutes at a quarter of
real time makes as many."""
CHECKPOINT_SECONDS = 1.0
"""Time of computing between two checkpoints [s]: the most that a restart computes again."""
_RESTING_SECONDS = 1.0
"""Shortest time between two checkpoints of a session that rests now and then [s]."""
_RETRY_SECONDS = 5.0
"""Time from a failed write to the next attempt [s]."""

Kept: TypeAlias = Literal["memory", "disk", "failing"]
"""Storage of a session. failing: its file cannot be written at present."""

_log = logging.getLogger(__name__)


class Journal:
    """All inputs of a simulation since frame 0. Used by the thread of its session.

    Whatever acts on the simulation is noted here before it acts. A file that cannot be written stops nothing:
    the session goes on in memory, `kept` is "failing", and some seconds later the whole journal is written
    again.

    Parameters
    ----------
    inputs : Inputs, optional
        Those that have acted already, and the pending ones.
    complete : bool
        Whether they are all since frame 0.
    pending : int
        Number of the last inputs that have not acted yet, since the simulation is being computed again.
    sketches : int
        Largest number of a sketch so far.
    links : int
        Number of times that links to the session were taken back.
    """

    def __init__(
        self,
        inputs: Inputs | None = None,
        *,
        complete: bool = True,
        pending: int = 0,
        sketches: int = 0,
        links: int = 0,
    ) -> None:
        self._inputs = inputs.copy() if inputs is not None and complete else Inputs()
        self._complete = complete
        self._pending = pending
        self.sketches = sketches
        """Largest number of a sketch so far; a reset does not begin anew."""
        self._links = links
        self._file: SessionFile | None = None
        self._kept: Kept = "memory"
        self._failed_at = 0.0
        self._checked_at = 0.0
        self._written_at = -math.inf

    @property
    def kept(self) -> Kept:
        """Storage of the session. Safe to read from any thread."""
        return self._kept

    @property
    def links(self) -> int:
        """Number of times that links to the session were taken back. Safe to read from any thread."""
        return self._links

    @property
    def inputs(self) -> Inputs | None:
        """A copy of all inputs, in the order in which they acted; None where there were too many."""
        return self._inputs.copy() if self._complete else None

    def fork(self) -> "Journal":
        """Return a journal of a copy of the simulation, without a file."""
        return Journal(self._inputs, complete=self._complete, sketches=self.sketches)

    def keep_in(self, file: SessionFile, computed_seconds: float = 0.0) -> None:
        """Write to a file from now on, which has the present inputs already."""
        self._file, self._kept, self._checked_at = file, "disk", computed_seconds

    def create(
        self,
        path: Path,
        origin: Origin,
        notice: str | None,
        computed_seconds: float,
        checkpoint: Checkpoint | None,
        *,
        owner: str = "",
    ) -> None:
        """Write to a new file from now on, with a checkpoint of the present state unless it is the first.

        Raises
        ------
        StorageError
            It cannot be written.
        """
        file = SessionFile.create(
            path,
            origin,
            inputs=self._inputs,
            complete=self._complete,
            sketches=self.sketches,
            checkpoint=checkpoint,
            notice=notice,
            owner=owner,
        )
        self.keep_in(file, computed_seconds)

    def add(self, made: Input, guidance: Callable[[], bytes] | None = None) -> None:
        """Note an input before it acts; of a sketch, `guidance` returns a snapshot of its guidance."""
        snapshot = None if guidance is None or self._file is None else guidance()
        if len(self._inputs) == MAX_INPUTS:
            self._inputs = Inputs()
            self._complete = False
        if self._complete:
            self._inputs.append(made)
        if isinstance(made, SketchInput):
            self.sketches = made.number
        self._write(lambda file: file.append(made, snapshot, complete=self._complete))

    def promise(self, inputs: Sequence[Input], frame: int) -> None:
        """Note inputs that will act in frames up to one that a tab has computed already."""
        for one in inputs:
            self._pending += 1
            self.add(one)
        self.mark(frame)

    def take_back(self, checkpoint: Checkpoint) -> None:
        """Forget the pending inputs, since a frame has failed; the checkpoint is of the present frame."""
        if self._complete:
            self._inputs = Inputs(self._inputs[place] for place in range(len(self._inputs) - self._pending))
        self._pending = 0
        self._write(
            lambda file: file.rewrite(
                self._inputs,
                checkpoint,
                complete=self._complete,
                reached=checkpoint.frame,
                notice=file.notice,
            )
        )

    def acted(self) -> None:
        """Note that the first pending input acts."""
        self._pending -= 1

    def plan(self, place: int, guidance: Callable[[], bytes]) -> None:
        """Note the guidance of the pending sketch at a place among all inputs, which was planned again."""
        self._write(lambda file: file.plan(place, guidance()))

    def clear(self) -> None:
        """Forget all inputs before the simulation returns to frame 0."""
        self._inputs = Inputs()
        self._complete = True
        self._write(lambda file: file.rewrite())

    def take_links_back(self) -> None:
        """Let no link to the session be valid that was made before."""
        self._links += 1
        self._write(lambda file: file.take_links_back(self._links))

    def mark(self, frame: int) -> None:
        """Note the frame that an answer reports to a client."""
        self._write(lambda file: file.mark(frame))

    def settle(
        self, computed_seconds: float, checkpoint: Callable[[], Checkpoint], *, resting: bool = False
    ) -> None:
        """Write a checkpoint if one is due, or everything if an earlier write failed.

        A `resting` session gets one after any computing, so that a restart does not compute again what many
        sessions computed one after the other.
        """
        if self.is_behind(computed_seconds, resting=resting):
            self.check(computed_seconds, checkpoint)

    def is_behind(self, computed_seconds: float, *, resting: bool) -> bool:
        """Return whether `settle` would write. Safe to call from any thread."""
        if self._file is None:
            return False
        if self._kept == "failing":
            return time.monotonic() - self._failed_at > _RETRY_SECONDS
        behind = computed_seconds - self._checked_at
        rested = resting and time.monotonic() - self._written_at > _RESTING_SECONDS
        return behind > (0.0 if rested else CHECKPOINT_SECONDS)

    def check(self, computed_seconds: float, checkpoint: Callable[[], Checkpoint]) -> None:
        """Write a checkpoint now, and everything else if an earlier write failed."""
        if self._file is None:
            return
        state = checkpoint()
        if self._kept == "failing" and not self._pending:
            self._kept = "disk"
            self._write(
                lambda file: file.rewrite(
                    self._inputs, state, complete=self._complete, notice=file.notice, links=self._links
                )
            )
        else:
            self._write(lambda file: file.check(state, self._pending))
        self._checked_at, self._written_at = computed_seconds, time.monotonic()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def discard(self) -> None:
        """Delete the file; nothing more is kept. It may still be in use by the session's thread.

        Raises
        ------
        StorageError
            It cannot be deleted.
        """
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

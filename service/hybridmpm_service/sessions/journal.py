"""Files of sessions on disk: origin, inputs and latest checkpoint of each.

A file is an SQLite database with a write-ahead log. An input is appended by one transaction. A checkpoint
replaces the older one whole or not at all. A log torn at its tail, by a crash or a full disk, is read up to
its last whole transaction. A killed process loses nothing that was committed. A power cut may lose the latest
transactions, since they are not forced to the disk one by one, but never damages the file.
"""

import contextlib
import json
import logging
import math
import re
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias

from pydantic import ValidationError

from hybridmpm.errors import ConfigError
from hybridmpm_service.errors import StorageError
from hybridmpm_service.sessions.inputs import INPUT, Input, Origin

_FORMAT = 1
_BEGUN = "begun"
"""Key of the session's start [s since 1970] in the record of the origin."""
_TABLES = """
CREATE TABLE origin (record TEXT NOT NULL);
CREATE TABLE progress (reached INTEGER NOT NULL, complete INTEGER NOT NULL);
CREATE TABLE inputs (number INTEGER PRIMARY KEY, record TEXT NOT NULL, guidance BLOB);
CREATE TABLE checkpoint (
    frame INTEGER NOT NULL, inputs INTEGER NOT NULL, state BLOB NOT NULL, guidance BLOB, rest TEXT NOT NULL
);
INSERT INTO progress VALUES (0, 1);
"""


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """State of a simulation after some frame."""

    frame: int
    """Number of the frame."""
    state: bytes
    """Snapshot of the simulator."""
    guidance: bytes | None
    """Snapshot of the guidance that steers; None where none does."""
    rest: Mapping[str, Any]
    """Other state of the simulation, as plain data."""


@dataclass(frozen=True, kw_only=True)
class Stored:
    """Contents of a session file."""

    origin: Origin
    inputs: tuple[Input, ...]
    """In the order in which they acted."""
    guidances: Mapping[int, bytes]
    """Snapshots of the guidances of sketches, by the place of the sketch among the inputs."""
    checkpoint: Checkpoint | None
    """None before the first."""
    checked: int
    """Number of inputs that the checkpoint contains."""
    reached: int
    """Latest frame that an answer reported to a client."""
    complete: bool
    """Whether the inputs are all since frame 0."""


def start_of(path: Path) -> float:
    """Return the start of a file's session [s since 1970]; an unreadable file counts as the newest."""
    try:
        with contextlib.closing(sqlite3.connect(path)) as database:
            (record,) = database.execute("SELECT record FROM origin").fetchone()
        return float(json.loads(record).get(_BEGUN, 0.0))
    except (sqlite3.Error, TypeError, ValueError, AttributeError):
        return math.inf


class SessionFile:
    """The file of one session. Used by one thread at a time.

    Each method that writes is one transaction, and raises StorageError where it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with _stored(path):
            # The threads of a session take turns.
            self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            self._database.execute("PRAGMA synchronous = NORMAL")

    @classmethod
    def create(cls, path: Path, origin: Origin) -> Self:
        """Return the new file of a session.

        Raises
        ------
        StorageError
            It cannot be written.
        """
        file = cls(path)
        try:
            with _stored(path):
                file._database.execute("PRAGMA journal_mode = WAL")
                file._database.execute(f"PRAGMA user_version = {_FORMAT}")
                file._database.executescript(_TABLES)
                record = json.dumps({_BEGUN: time.time(), **origin.record()})
                file._database.execute("INSERT INTO origin VALUES (?)", (record,))
        except StorageError:
            file.close()
            file.remove()
            raise
        return file

    def read(self) -> Stored:
        """Return the contents of the file.

        Raises
        ------
        StorageError
            The file is damaged, or of another version.
        """
        with _stored(self._path):
            (version,) = self._database.execute("PRAGMA user_version").fetchone()
            if version != _FORMAT:
                raise StorageError(f"{self._path} has the format {version}, this service reads {_FORMAT}")
            (origin,) = self._database.execute("SELECT record FROM origin").fetchone()
            reached, complete = self._database.execute("SELECT reached, complete FROM progress").fetchone()
            rows = self._database.execute("SELECT record, guidance FROM inputs ORDER BY number").fetchall()
            found = self._database.execute("SELECT * FROM checkpoint").fetchone()
        try:
            checkpoint, checked = None, 0
            if found is not None:
                frame, checked, state, guidance, rest = found
                checkpoint = Checkpoint(frame=frame, state=state, guidance=guidance, rest=json.loads(rest))
            return Stored(
                origin=Origin.of_record(json.loads(origin)),
                inputs=tuple(INPUT.validate_json(record) for record, _ in rows),
                guidances={place: row[1] for place, row in enumerate(rows) if row[1] is not None},
                checkpoint=checkpoint,
                checked=checked,
                reached=reached,
                complete=bool(complete),
            )
        except (KeyError, TypeError, ValueError) as err:
            why = err.errors(include_url=False)[0]["msg"] if isinstance(err, ValidationError) else err
            raise StorageError(f"{self._path} is damaged: {why}") from err

    def append(self, made: Input, guidance: bytes | None) -> None:
        """Add an input, with a snapshot of its guidance if it is a sketch."""
        with self._transaction() as database:
            _insert(database, made, guidance)

    def mark(self, frame: int) -> None:
        """Note the frame that an answer reports to a client."""
        with self._transaction() as database:
            database.execute("UPDATE progress SET reached = ?", (frame,))

    def overflow(self) -> None:
        """Note that from now on the inputs are not all since frame 0."""
        with self._transaction() as database:
            database.execute("UPDATE progress SET complete = 0")

    def check(self, checkpoint: Checkpoint) -> None:
        """Replace the checkpoint by one that contains all inputs so far."""
        with self._transaction() as database:
            _check(database, checkpoint)

    def clear(self) -> None:
        """Forget everything but the origin: the session is at frame 0 again."""
        with self._transaction() as database:
            _clear(database)

    def rewrite(self, inputs: Sequence[Input], checkpoint: Checkpoint, *, complete: bool) -> None:
        """Replace everything by these inputs, and a checkpoint that contains them."""
        with self._transaction() as database:
            _clear(database)
            for made in inputs:
                _insert(database, made, None)
            _check(database, checkpoint)
            database.execute("UPDATE progress SET complete = ?", (complete,))

    def close(self) -> None:
        """Close the file."""
        with contextlib.suppress(sqlite3.Error):
            self._database.close()

    def remove(self) -> None:
        """Delete the file, which may still be open."""
        for suffix in ("", "-wal", "-shm"):
            self._path.with_name(self._path.name + suffix).unlink(missing_ok=True)

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with _stored(self._path):
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield self._database
                self._database.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):
                    self._database.execute("ROLLBACK")
                raise


def _insert(database: sqlite3.Connection, made: Input, guidance: bytes | None) -> None:
    database.execute(
        "INSERT INTO inputs (record, guidance) VALUES (?, ?)", (made.model_dump_json(), guidance)
    )


def _check(database: sqlite3.Connection, checkpoint: Checkpoint) -> None:
    (inputs,) = database.execute("SELECT count(*) FROM inputs").fetchone()
    # The checkpoint contains the guidance that still steers.
    database.execute("UPDATE inputs SET guidance = NULL WHERE guidance IS NOT NULL")
    database.execute("DELETE FROM checkpoint")
    database.execute(
        "INSERT INTO checkpoint VALUES (?, ?, ?, ?, ?)",
        (
            checkpoint.frame,
            inputs,
            checkpoint.state,
            checkpoint.guidance,
            json.dumps(dict(checkpoint.rest)),
        ),
    )


def _clear(database: sqlite3.Connection) -> None:
    database.execute("DELETE FROM inputs")
    database.execute("DELETE FROM checkpoint")
    database.execute("UPDATE progress SET reached = 0, complete = 1")


@contextlib.contextmanager
def _stored(path: Path) -> Iterator[None]:
    try:
        yield
    except (sqlite3.Error, OSError) as err:
        raise StorageError(f"{path} cannot be read or written: {err}") from err


_SUFFIX = ".session"
_NAME = re.compile(r"[0-9a-f]{32}")


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
            # The system releases the lock when the process ends, in any way.
            self._lock = sqlite3.connect(path / "lock", timeout=0, isolation_level=None)
            self._lock.execute("BEGIN EXCLUSIVE")
        except (sqlite3.Error, OSError) as err:
            raise ConfigError(
                f"state_folder: {path} cannot be used: {err}. It must be a folder that the service may "
                "write, and that no other service uses"
            ) from None

    def names(self) -> list[str]:
        """Return the names of the sessions that have a file, in the order in which they began."""
        files = [path for path in self._path.glob(f"*{_SUFFIX}") if _NAME.fullmatch(path.stem)]
        return [path.stem for path in sorted(files, key=lambda path: (start_of(path), path.stem))]

    def create(self, name: str, origin: Origin) -> SessionFile:
        """Return the new file of a session; errors as `SessionFile.create`."""
        return SessionFile.create(self._path / f"{name}{_SUFFIX}", origin)

    def open(self, name: str) -> SessionFile:
        """Return the file of a session that `names` lists.

        Raises
        ------
        StorageError
            It cannot be read.
        """
        return SessionFile(self._path / f"{name}{_SUFFIX}")

    def close(self) -> None:
        """Let another service use the folder."""
        self._lock.close()


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

"""The file of a session: origin, inputs and latest checkpoint.

A file is an SQLite database with a write-ahead log. Its creation is one transaction under another name, so a
session file is whole from the start. An input is appended by one transaction. A checkpoint replaces the older
one whole or not at all. A log torn at its tail, by a crash or a full disk, is read up to its last whole
transaction. A killed process loses nothing that was committed. A power cut may lose the latest transactions,
since they are not forced to the disk one by one, but never damages the file.

Each transaction renews a seal, with digests of all that the file contains. A file that was edited or damaged
is therefore refused, and never continued in another state.
"""

import contextlib
import hashlib
import json
import math
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from pydantic import Field, ValidationError

from hybridmpm_service.errors import StorageError
from hybridmpm_service.sessions.inputs import INPUT, Frame, Input, Inputs, Origin, SketchInput, Strict

_SUFFIXES = ("", "-wal", "-shm", "-journal")
PART_SUFFIX = ".new"
"""Suffix of a file that is being created."""
_FORMAT = 2
_BEGUN = "begun"
"""Key of the session's start [s since 1970] in the record of the origin."""
_OWNER = "owner"
"""Key of the name of the key that the session belongs to, there as well."""
_TABLES = (
    "CREATE TABLE origin (record TEXT NOT NULL)",
    "CREATE TABLE inputs (number INTEGER PRIMARY KEY, record TEXT NOT NULL)",
    "CREATE TABLE plans (number INTEGER PRIMARY KEY, guidance BLOB NOT NULL)",
    """CREATE TABLE checkpoint (
    frame INTEGER NOT NULL, acted INTEGER NOT NULL, state BLOB NOT NULL, guidance BLOB, rest TEXT NOT NULL
    )""",
    "CREATE TABLE seal (record TEXT NOT NULL, digest TEXT NOT NULL)",
)


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
    inputs: Inputs
    """In the order in which they acted."""
    guidances: Mapping[int, bytes]
    """Snapshots of the guidances of sketches, by the place of the sketch among the inputs."""
    checkpoint: Checkpoint | None
    """None before the first."""
    acted: int
    """Number of inputs that the checkpoint contains."""
    reached: int
    """Latest frame that an answer reported to a client."""
    complete: bool
    """Whether the log of the session is whole: it has not had more than `MAX_INPUTS` inputs."""
    sketches: int
    """Largest number of a sketch so far."""
    notice: str | None
    """Remark on a session that may differ from its former state."""
    links: int
    """Number of times that links to the session were taken back."""


class _Seal(Strict):
    """Counts and digests of all that a file contains, and the fields of `Stored` of the same names."""

    origin: str
    """Digest of the record of the origin."""
    inputs: int = 0
    """Number of inputs."""
    chain: str = ""
    """Digest of all inputs in their order."""
    plans: dict[str, str] = Field(default_factory=dict)
    """Digests of the guidances that the checkpoint does not contain, by the numbers of their inputs."""
    checkpoint: str = ""
    """Digest of the checkpoint; empty before the first."""
    reached: Frame = 0
    complete: bool = True
    sketches: int = Field(default=0, ge=0)
    notice: str | None = None
    links: int = Field(default=0, ge=0)


def start_of(path: Path) -> tuple[float, str]:
    """Return the start of a file's session [s since 1970], and its owner.

    An unreadable file counts as the newest, and is of nobody.
    """
    try:
        with contextlib.closing(sqlite3.connect(path)) as database:
            (record,) = database.execute("SELECT record FROM origin").fetchone()
        found = json.loads(record)
        return float(found.get(_BEGUN, 0.0)), str(found.get(_OWNER, ""))
    except Exception:  # noqa: BLE001 - foreign data, which `read` refuses with its fault
        return math.inf, ""


def size_of(path: Path) -> int:
    """Return the size of a session's file, with what belongs to it [bytes]."""
    sizes = 0
    for suffix in _SUFFIXES:
        with contextlib.suppress(OSError):
            sizes += path.with_name(path.name + suffix).stat().st_size
    return sizes


class SessionFile:
    """The file of one session. Used by one thread at a time.

    Each method that writes is one transaction, and raises StorageError where it cannot be written. A file
    that exists is read before it is written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seal = _Seal(origin="")
        with _stored(path):
            # The threads of a session take turns.
            self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            try:
                self._database.execute("PRAGMA journal_mode = WAL")
                self._database.execute("PRAGMA synchronous = NORMAL")
            except BaseException:
                self._database.close()
                raise

    @classmethod
    def create(
        cls,
        path: Path,
        origin: Origin,
        *,
        inputs: Sequence[Input] = (),
        complete: bool = True,
        sketches: int = 0,
        checkpoint: Checkpoint | None = None,
        notice: str | None = None,
        owner: str = "",
    ) -> Self:
        """Return the new file of a session, whose checkpoint contains all inputs.

        Raises
        ------
        StorageError
            It cannot be written.
        """
        part = path.with_suffix(PART_SUFFIX)
        try:
            with _stored(path), contextlib.closing(sqlite3.connect(part, isolation_level=None)) as database:
                database.execute("BEGIN IMMEDIATE")
                for table in _TABLES:
                    database.execute(table)
                record = json.dumps({_BEGUN: time.time(), _OWNER: owner, **origin.record()})
                seal = _Seal(origin=_digest(record), complete=complete, sketches=sketches, notice=notice)
                database.execute("INSERT INTO origin VALUES (?)", (record,))
                database.execute("INSERT INTO seal VALUES ('', '')")
                _fill(database, seal, inputs, checkpoint)
                _renew(database, seal)
                database.execute(f"PRAGMA user_version = {_FORMAT}")
                database.execute("COMMIT")
            with _stored(path):
                part.replace(path)
            file = cls(path)
        except StorageError:
            remove(part)
            remove(path)
            raise
        file._seal = seal
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
            rows = {
                name: self._database.execute(f"SELECT * FROM {name} ORDER BY rowid").fetchall()  # noqa: S608
                for name in ("seal", "origin", "inputs", "plans", "checkpoint")
            }
        try:
            stored, self._seal = _read(rows)
        except Exception as err:  # foreign data may be anything
            raise StorageError(f"{self._path} is damaged: {_first(err)}") from err
        return stored

    @property
    def notice(self) -> str | None:
        """Remark on a session that may differ from its former state."""
        return self._seal.notice

    def append(self, made: Input, guidance: bytes | None, *, complete: bool = True) -> None:
        """Add an input, with a snapshot of its guidance if it is a sketch.

        `complete` says whether the log is whole with it.
        """
        with self._transaction() as (database, seal):
            number = _insert(database, seal, made)
            if guidance is not None:
                _plan(database, seal, number, guidance)
            seal.complete = complete

    def plan(self, place: int, guidance: bytes) -> None:
        """Add the snapshot of a guidance that was planned again, of the sketch at a place of the inputs."""
        with self._transaction() as (database, seal):
            query = "SELECT number FROM inputs ORDER BY number LIMIT 1 OFFSET ?"
            (number,) = database.execute(query, (place,)).fetchone()
            _plan(database, seal, number, guidance)

    def mark(self, frame: int) -> None:
        """Note the frame that an answer reports to a client."""
        with self._transaction() as (_, seal):
            seal.reached = frame

    def check(self, checkpoint: Checkpoint, pending: int = 0) -> None:
        """Replace the checkpoint by one that contains all inputs but the last `pending`."""
        with self._transaction() as (database, seal):
            _check(database, seal, checkpoint, pending)

    def take_links_back(self, links: int) -> None:
        """Note how often the links to the session have been taken back."""
        with self._transaction() as (_, seal):
            seal.links = links

    def rewrite(
        self,
        inputs: Sequence[Input] = (),
        checkpoint: Checkpoint | None = None,
        *,
        complete: bool = True,
        origin: Origin | None = None,
        reached: int = 0,
        notice: str | None = None,
        links: int | None = None,
    ) -> None:
        """Replace everything by these inputs, and a checkpoint that contains them, if one is given.

        The origin stays unless another is given, and the start of the session stays in any case. Without a
        checkpoint the inputs have not acted yet.
        """
        with self._transaction() as (database, seal):
            for table in ("inputs", "plans", "checkpoint"):
                database.execute(f"DELETE FROM {table}")  # noqa: S608
            seal.inputs, seal.chain, seal.plans, seal.checkpoint = 0, "", {}, ""
            seal.complete, seal.reached, seal.notice = complete, reached, notice
            seal.links = seal.links if links is None else links
            if origin is not None:
                (record,) = database.execute("SELECT record FROM origin").fetchone()
                record = json.dumps(json.loads(record) | origin.record())
                database.execute("UPDATE origin SET record = ?", (record,))
                seal.origin = _digest(record)
            _fill(database, seal, inputs, checkpoint)

    def close(self) -> None:
        """Close the file."""
        with contextlib.suppress(sqlite3.Error):
            self._database.close()

    def remove(self) -> None:
        """Delete the file, which may still be open.

        Raises
        ------
        StorageError
            It cannot be deleted.
        """
        with _stored(self._path):
            remove(self._path)

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[tuple[sqlite3.Connection, _Seal]]:
        """Yield the database and a copy of the seal, which becomes the file's with the transaction."""
        seal = self._seal.model_copy(deep=True)
        with _stored(self._path):
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield self._database, seal
                _renew(self._database, seal)
                self._database.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):
                    self._database.execute("ROLLBACK")
                raise
        self._seal = seal


def _read(rows: Mapping[str, list[tuple[Any, ...]]]) -> tuple[Stored, _Seal]:
    """Return the contents of the rows of a file, and its seal; raises any exception where it is damaged."""
    ((text, digest),) = _of_number(rows, "seal", 1)
    if _digest(text) != digest:
        raise ValueError("its seal is broken")
    seal = _Seal.model_validate_json(text)
    ((record,),) = _of_number(rows, "origin", 1)
    chain = ""
    for _, one in _of_number(rows, "inputs", seal.inputs):
        chain = _digest(chain, one)
    found = _of_number(rows, "checkpoint", 1 if seal.checkpoint else 0)
    sealed = {
        "origin": (_digest(record), seal.origin),
        "inputs": (chain, seal.chain),
        "plans": ({str(number): _digest(data) for number, data in rows["plans"]}, seal.plans),
        "checkpoint": (_digest(*found[0]) if found else "", seal.checkpoint),
    }
    for name, (present, expected) in sealed.items():
        if present != expected:
            raise ValueError(f"{name} and seal differ")
    places = {number: place for place, (number, _) in enumerate(rows["inputs"])}
    checkpoint, acted = None, 0
    if found:
        frame, acted, state, guidance, rest = found[0]
        if not 0 <= acted <= seal.inputs:
            raise ValueError(f"its checkpoint contains {acted} of {seal.inputs} inputs")
        checkpoint = Checkpoint(frame=frame, state=state, guidance=guidance, rest=json.loads(rest))
    stored = Stored(
        origin=Origin.of_record(json.loads(record)),
        inputs=Inputs(INPUT.validate_json(one) for _, one in rows["inputs"]),
        guidances={places[number]: data for number, data in rows["plans"]},
        checkpoint=checkpoint,
        acted=acted,
        reached=seal.reached,
        complete=seal.complete,
        sketches=seal.sketches,
        notice=seal.notice,
        links=seal.links,
    )
    return stored, seal


def _of_number(rows: Mapping[str, list[tuple[Any, ...]]], name: str, number: int) -> list[tuple[Any, ...]]:
    """Return the rows of a table that has to have some number of them."""
    if len(rows[name]) != number:
        raise ValueError(f"{name} has {len(rows[name])} rows instead of {number}")
    return rows[name]


def _digest(*parts: object) -> str:
    """Return a digest of the values of a row."""
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode()
        digest.update(f"{type(part).__name__} {len(data)} ".encode())
        digest.update(data)
    return digest.hexdigest()


def _first(err: Exception) -> str:
    """Return the first line of an error's text, that of a ValidationError without its address."""
    if isinstance(err, ValidationError):
        return err.errors(include_url=False)[0]["msg"]
    return next(iter(str(err).splitlines()), type(err).__name__)


def _renew(database: sqlite3.Connection, seal: _Seal) -> None:
    record = seal.model_dump_json()
    database.execute("UPDATE seal SET record = ?, digest = ?", (record, _digest(record)))


def _fill(
    database: sqlite3.Connection, seal: _Seal, inputs: Sequence[Input], checkpoint: Checkpoint | None
) -> None:
    for made in inputs:
        _insert(database, seal, made)
    if checkpoint is not None:
        _check(database, seal, checkpoint)


def _insert(database: sqlite3.Connection, seal: _Seal, made: Input) -> int:
    """Add an input; return its number."""
    record = made.model_dump_json()
    number = database.execute("INSERT INTO inputs (record) VALUES (?)", (record,)).lastrowid
    seal.inputs, seal.chain = seal.inputs + 1, _digest(seal.chain, record)
    if isinstance(made, SketchInput):
        seal.sketches = max(seal.sketches, made.number)
    return number or 0


def _plan(database: sqlite3.Connection, seal: _Seal, number: int, guidance: bytes) -> None:
    database.execute("INSERT OR REPLACE INTO plans VALUES (?, ?)", (number, guidance))
    seal.plans[str(number)] = _digest(guidance)


def _check(database: sqlite3.Connection, seal: _Seal, checkpoint: Checkpoint, pending: int = 0) -> None:
    query = "SELECT number FROM inputs ORDER BY number DESC LIMIT 1 OFFSET ?"
    (last,) = database.execute(query, (pending,)).fetchone() or (0,)
    # The checkpoint contains the guidance that still steers.
    database.execute("DELETE FROM plans WHERE number <= ?", (last,))
    seal.plans = {number: digest for number, digest in seal.plans.items() if int(number) > last}
    if not seal.complete:
        # There is no log any more, and the file would grow without end.
        database.execute("DELETE FROM inputs WHERE number <= ?", (last,))
        seal.inputs, seal.chain = 0, ""
        for (record,) in database.execute("SELECT record FROM inputs ORDER BY number"):
            seal.inputs, seal.chain = seal.inputs + 1, _digest(seal.chain, record)
    row = (
        checkpoint.frame,
        seal.inputs - pending,
        checkpoint.state,
        checkpoint.guidance,
        json.dumps(dict(checkpoint.rest)),
    )
    database.execute("DELETE FROM checkpoint")
    database.execute("INSERT INTO checkpoint VALUES (?, ?, ?, ?, ?)", row)
    seal.checkpoint = _digest(*row)


def remove(path: Path) -> None:
    """Delete a file of SQLite with what belongs to it."""
    for suffix in _SUFFIXES:
        path.with_name(path.name + suffix).unlink(missing_ok=True)


@contextlib.contextmanager
def _stored(path: Path) -> Iterator[None]:
    try:
        yield
    except (sqlite3.Error, OSError) as err:
        raise StorageError(f"{path} cannot be read or written: {err}") from err

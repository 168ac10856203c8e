"""Files that were edited, torn or flipped: each is refused in one sentence, or comes back as it was."""

# ruff: noqa: S608

import asyncio
import json
import logging
import random
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.conftest import ARROW, OPEN_SCENE, OVAL

from hybridmpm.control import push
from hybridmpm_service import Settings
from hybridmpm_service.errors import SessionNotFoundError
from hybridmpm_service.sessions import session_file
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.sessions.scene_work import SceneSource
from hybridmpm_service.sessions.viewers import Mailbox

_VALUES: tuple[Any, ...] = (None, 0, 1, -1, 7, 1.5, "x", b"\x00\xff", "", "[" * 5000, 10**18)
_JSON_VALUES: tuple[Any, ...] = (None, 0, -1, 1.5, "x", [], {}, True)
Edit = tuple[str, tuple[Any, ...]]
"""A statement and its values."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the file of a session with all kinds of inputs around its checkpoint, and its digest."""
    folder = tmp_path_factory.mktemp("whole")
    left, digests = folder / "left.session", []

    async def play() -> None:
        manager = SessionManager(Settings(max_load=64.0, state_folder=str(folder / "live")))
        session = await manager.create(SceneSource(data=OPEN_SCENE))
        hand = Mailbox()
        await session.advance(3)
        await session.steer(ARROW, most=400, frames=20)
        session.push(push((0.5, 0.4), (1.0, 0.0), 0.1), by=hand)
        await session.advance(4)
        simulation = session.simulation
        simulation.journal.check(simulation.computed_seconds, simulation.checkpoint)
        await session.release()
        session.push(None, by=hand)
        await session.steer(OVAL, most=400, hold=10)
        await session.advance(3)
        digests.append(simulation.particles().digest())
        with closing(sqlite3.connect(folder / "live" / f"{session.id}.session")) as database:
            database.execute(f"VACUUM INTO '{left}'")
        await manager.close()

    asyncio.run(play())
    return left, digests[0]


def _revive(folder: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Revive a folder; return the digests of its sessions, and why the others were refused."""
    found: dict[str, str] = {}
    refused: dict[str, str] = {}
    names = [path.stem for path in folder.glob("*.session")]

    async def play() -> None:
        manager = SessionManager(Settings(max_load=64.0, state_folder=str(folder)))
        await manager.revive()
        found.update({one.id: one.simulation.particles().digest() for one in manager.all()})
        for name in names:
            try:
                manager.get(name)
            except SessionNotFoundError as err:
                refused[name] = str(err)
        await manager.close()

    asyncio.run(play())
    return found, refused


def _edited(file: Path, folder: Path, edits: list[Edit], *, sealed: bool = False) -> None:
    folder.mkdir()
    for number, edit in enumerate(edits):
        path = folder / f"{number:032x}.session"
        shutil.copy(file, path)
        with closing(sqlite3.connect(path)) as database, database:
            database.execute("PRAGMA synchronous = OFF")
            try:
                database.execute(*edit)
            except sqlite3.IntegrityError:  # The table does not take the value.
                continue
            if sealed:
                with suppress(
                    ValueError, TypeError, RecursionError, sqlite3.Error
                ):  # No seal is left to write again.
                    _seal_again(database)


def _seal_again(database: sqlite3.Connection) -> None:
    """Write the digests that belong to the edited contents, as a program that made them would."""
    (text,) = database.execute("SELECT record FROM seal").fetchone()
    seal, rows = json.loads(text), database.execute("SELECT record FROM inputs ORDER BY number").fetchall()
    chain = ""
    for (record,) in rows:
        chain = session_file._digest(chain, record)
    seal |= {"inputs": len(rows), "chain": chain} if "chain" in seal else {}
    origin = database.execute("SELECT record FROM origin").fetchone()
    checkpoint = database.execute("SELECT * FROM checkpoint").fetchone()
    seal["origin"] = session_file._digest(*(origin or ()))
    seal["checkpoint"] = "" if checkpoint is None else session_file._digest(*checkpoint)
    plans = database.execute("SELECT number, guidance FROM plans").fetchall()
    seal["plans"] = {str(number): session_file._digest(data) for number, data in plans}
    text = json.dumps(seal)
    database.execute("UPDATE seal SET record = ?, digest = ?", (text, session_file._digest(text)))


def _of_columns(file: Path) -> Iterator[Edit]:
    """Yield edits of every table and column, of rows and of the tables themselves."""
    with closing(sqlite3.connect(file)) as database:
        tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        columns = [
            (table, row[1]) for table in tables for row in database.execute(f"PRAGMA table_info({table})")
        ]
    assert len(columns) == 12
    for table, column in columns:
        for value in _VALUES:
            yield f"UPDATE {table} SET {column} = ? WHERE rowid = (SELECT max(rowid) FROM {table})", (value,)
    for table in tables:
        yield f"DELETE FROM {table}", ()
        yield f"DELETE FROM {table} WHERE rowid = (SELECT max(rowid) FROM {table})", ()
        yield f"DROP TABLE {table}", ()
        yield f"ALTER TABLE {table} ADD COLUMN more", ()
        yield f"ALTER TABLE {table} RENAME TO other", ()
    for version in (0, 1, 9):
        yield f"PRAGMA user_version = {version}", ()


def _of_json(file: Path) -> Iterator[Edit]:
    """Yield edits of each value within each record of JSON."""
    for table, column in (
        ("origin", "record"),
        ("inputs", "record"),
        ("checkpoint", "rest"),
        ("seal", "record"),
    ):
        with closing(sqlite3.connect(file)) as database:
            rows = database.execute(f"SELECT rowid, {column} FROM {table}").fetchall()
        for row, text in rows:
            for where in _places(json.loads(text)):
                for value in (*_JSON_VALUES, ...):
                    record = json.loads(text)
                    inner = record
                    for key in where[:-1]:
                        inner = inner[key]
                    if value is ...:
                        del inner[where[-1]]
                    else:
                        inner[where[-1]] = value
                    yield f"UPDATE {table} SET {column} = ? WHERE rowid = ?", (json.dumps(record), row)


def _places(value: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield (*above, key)
        yield from _places(one, (*above, key))


@pytest.mark.parametrize("share", [0.06, pytest.param(1.0, marks=pytest.mark.long)])
@pytest.mark.parametrize("sealed", [False, True])
def test_an_edited_file_is_refused_or_comes_back(
    tmp_path: Path, whole: tuple[Path, str], caplog: pytest.LogCaptureFixture, *, sealed: bool, share: float
) -> None:
    """Edits of columns are all tried; of those within JSON, a share."""
    file, digest = whole
    inner = list(_of_json(file))
    chosen = random.Random(int(sealed)).sample(inner, round(share * len(inner)))
    edits: list[Edit] = [("SELECT 1", ())] * 2 + [*_of_columns(file), *chosen]
    _edited(file, tmp_path / "edited", edits, sealed=sealed)
    files = {path: path.read_bytes() for path in (tmp_path / "edited").glob("*.session")}
    with caplog.at_level(logging.ERROR):
        found, refused = _revive(tmp_path / "edited")
    assert len(found) + len(refused) == len(edits) == len(files)
    assert found[f"{0:032x}"] == found[f"{1:032x}"] == digest
    if not sealed:
        assert set(found.values()) == {digest}
    assert len(refused) > 100
    assert sorted(record.args[0] for record in caplog.records) == sorted(refused)  # type: ignore[index]
    for name, why in refused.items():
        assert "\n" not in why
        assert (tmp_path / "edited" / f"{name}.session").exists()


def test_a_torn_or_flipped_file_is_refused_or_comes_back(tmp_path: Path, whole: tuple[Path, str]) -> None:
    file, digest = whole
    data, rng = file.read_bytes(), np.random.default_rng(5)
    for number in range(120):
        changed = bytearray(data)
        if number < 30:
            changed = changed[: number * len(data) // 30]
        else:
            changed[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        (tmp_path / f"{number:032x}.session").write_bytes(changed)
    found, refused = _revive(tmp_path)
    assert len(found) + len(refused) == 120
    assert set(found.values()) <= {digest}
    assert len(refused) > 60

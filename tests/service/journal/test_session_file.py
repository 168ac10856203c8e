"""The file of a session: what is written is read again, whatever happens to its tail."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from tests.service.conftest import SCENE

from hybridmpm import MpmSolver
from hybridmpm.control import Arrow, Ellipse, Push
from hybridmpm_service.errors import StorageError
from hybridmpm_service.sessions.inputs import (
    Input,
    LimitedSettings,
    Origin,
    PushInput,
    ReleaseInput,
    SketchInput,
    SketchRecord,
    hand_input,
)
from hybridmpm_service.sessions.session_file import Checkpoint, SessionFile
from hybridmpm_service.sessions.solvers import ChosenSolver

ORIGIN = Origin.of(SCENE, ChosenSolver(MpmSolver(SCENE)), None, None)
HAND = Push(np.array([0.5, 0.1]), np.array([1.0, 1e-17]), 0.1, 15.0)
SKETCHES = (
    Arrow(np.array([[0.1, 0.2], [0.3, 1 / 3]]), np.array([4.0, 7.0])),
    Ellipse(np.array([0.5, 0.5]), np.array([0.2, 0.1]), 0.1 + 0.2),
)
INPUTS: tuple[Input, ...] = (
    *(
        SketchInput(
            frame=3 + number,
            number=number,
            drawn_frame=2,
            planned_by="analytic",
            sketch=SketchRecord.of(sketch),
            settings=LimitedSettings(cap=12.0, most=400),
        )
        for number, sketch in enumerate(SKETCHES, start=1)
    ),
    hand_input(6, HAND),
    PushInput(frame=7, push=None),
    ReleaseInput(frame=9),
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "one.session"


def test_inputs_origin_and_checkpoint_come_back(path: Path) -> None:
    file = SessionFile.create(path, ORIGIN)
    for place, one in enumerate(INPUTS[:3]):
        file.append(one, f"guidance {place}".encode() if place < 2 else None)
    assert file.read().guidances == {0: b"guidance 0", 1: b"guidance 1"}
    checkpoint = Checkpoint(frame=6, state=b"state", guidance=b"steers", rest={"steered": True})
    file.check(checkpoint)
    for one in INPUTS[3:]:
        file.append(one, None)
    file.mark(12)
    file.close()
    stored = SessionFile(path).read()
    assert stored.origin.record() == ORIGIN.record()
    assert tuple(stored.inputs) == INPUTS
    assert (stored.acted, stored.reached, stored.complete) == (3, 12, True)
    assert stored.checkpoint == checkpoint
    assert stored.guidances == {}


@pytest.mark.parametrize("lost", [1, 7, 100, 5000])
def test_a_tail_that_is_torn_off_costs_the_latest_inputs_alone(path: Path, lost: int) -> None:
    file = SessionFile.create(path, ORIGIN)
    for _ in range(5):
        for one in INPUTS:
            file.append(one, None)
    # As a crash would leave it: nothing is closed, and the end of what was written last is missing.
    torn = path.with_name("torn.session")
    torn.write_bytes(path.read_bytes())
    log = path.with_name(path.name + "-wal").read_bytes()
    torn.with_name(torn.name + "-wal").write_bytes(log[:-lost])
    stored = SessionFile(torn).read()
    assert 0 < len(stored.inputs) < 5 * len(INPUTS)
    assert tuple(stored.inputs) == (5 * INPUTS)[: len(stored.inputs)]


def test_a_file_of_another_format_is_refused_with_both(path: Path) -> None:
    SessionFile.create(path, ORIGIN).close()
    with sqlite3.connect(path) as database:
        database.execute("PRAGMA user_version = 9")
    with pytest.raises(StorageError, match="has the format 9, this service reads 2"):
        SessionFile(path).read()


def test_a_write_that_fails_leaves_the_file_as_it_was(path: Path) -> None:
    """A disk that is full, as SQLite meets it: the database may not grow any more."""
    file = SessionFile.create(path, ORIGIN)
    file.append(INPUTS[0], None)
    pages = file._database.execute("PRAGMA page_count").fetchone()[0]
    file._database.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(StorageError, match="full"):
        file.check(Checkpoint(frame=6, state=bytes(1 << 20), guidance=None, rest={}))
    stored = file.read()
    assert (len(stored.inputs), stored.checkpoint) == (1, None)

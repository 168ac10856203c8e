"""A session that is left in the middle goes on with the same bits: after a crash, a stop, or from its log."""

import asyncio
import contextlib
import dataclasses
import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.conftest import ARROW, OPEN_SCENE, OVAL, SCENE, SOURCE, until

from hybridmpm import Box, Scene, SimulationError
from hybridmpm.control import push
from hybridmpm.errors import ConfigError
from hybridmpm_service import Settings
from hybridmpm_service.errors import SessionNotFoundError, StorageError, UnavailableError
from hybridmpm_service.sessions import journal, session_file
from hybridmpm_service.sessions.inputs import hand_input
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.sessions.scene_work import SceneSource
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import SolverChoice
from hybridmpm_service.sessions.viewers import Mailbox

pytestmark = pytest.mark.anyio
FINE_SCENE = Scene(dim=2, resolution=128, bodies=(Box(lower=(0.4, 0.4), upper=(0.5, 0.5), material="water"),))
CASES = {
    "mpm": (SCENE, None),
    "open": (OPEN_SCENE, None),
    "coarse": (SCENE, SolverChoice(coarse="1/4")),
    "hybrid": (FINE_SCENE, SolverChoice(solver="hybrid", model="fluids_2d")),
}


@contextlib.asynccontextmanager
async def _service(folder: Path | None, **settings: Any) -> AsyncIterator[SessionManager]:
    """Begin a service's life with what lies in a folder, and end it in order."""
    state = "" if folder is None else str(folder)
    manager = SessionManager(Settings(max_load=64.0, state_folder=state, **settings))
    try:
        await manager.revive()
        yield manager
    finally:
        await manager.close()


def _killed(live: Path, left: Path) -> None:
    """Copy what a process would leave behind that is killed now."""
    shutil.copytree(live, left, ignore=shutil.ignore_patterns("lock*"))


def _files(folder: Path) -> list[str]:
    return [path.name for path in folder.glob("*.session")]


async def _story(session: Session) -> None:
    """Do all that can be done to a session, up to frame 60; a sketch steers then."""
    hand = Mailbox()
    await session.advance(5)
    await session.steer(ARROW, most=400, frames=20)
    await session.advance(7)
    session.push(push((0.5, 0.4), (1.0, 0.0), 0.1), by=hand)
    await session.advance(6)
    session.push(push((0.55, 0.4), (0.0, 1.0), 0.1), by=hand)
    await session.advance(3)
    session.push(None, by=hand)
    await session.release()
    await session.advance(9)
    await session.steer(OVAL, most=400, hold=10)
    await session.advance(30)


async def _digest(session: Session, frames: int = 0) -> str:
    if frames:
        await session.advance(frames)
    return (await session.log()).digest


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("interval", [0.0, 1e9], ids=["checkpoints", "inputs alone"])
async def test_a_crash_costs_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str, interval: float
) -> None:
    """What lies on the disk while a session lives is what a killed process leaves."""
    monkeypatch.setattr(journal, "CHECKPOINT_SECONDS", interval)
    left = tmp_path / "left"
    async with _service(tmp_path / "live") as manager:
        session = await manager.create(SceneSource(data=CASES[case][0]), choice=CASES[case][1])
        assert session.kept == "disk"
        await _story(session)
        _killed(tmp_path / "live", left)
        digests = [await _digest(session), await _digest(session, 25)]
    async with _service(left) as manager:
        (session,) = manager.all()
        assert (session.view.frame, session.notice, session.kept) == (60, None, "disk")
        assert (session.control.number, session.control.phase) == (2, "steering")
        assert [await _digest(session), await _digest(session, 25)] == digests
        # Nor is a number given to two sketches.
        assert (await session.steer(ARROW, most=400, frames=20)).number == 3


async def test_a_stop_keeps_what_the_player_has_computed(tmp_path: Path) -> None:
    async with _service(tmp_path) as manager:
        session = await manager.create(SOURCE)
        with session.viewer():
            session.play()
            await until(lambda: session.view.frame >= 12)
        await until(lambda: not session.playing)
        await session.particles()
        frame = session.view.frame
    async with _service(tmp_path) as manager:
        assert [session.view.frame for session in manager.all()] == [frame]


async def test_what_was_deleted_expired_or_reset_stays_so(tmp_path: Path) -> None:
    async with _service(tmp_path) as manager:
        deleted, reset = (
            await manager.create(SOURCE),
            await manager.create(SOURCE),
        )
        await _story(reset)
        await reset.reset()
        await manager.delete(deleted.id)
        assert _files(tmp_path) == [f"{reset.id}.session"]
    async with _service(tmp_path) as manager:
        assert [(session.id, session.view.frame) for session in manager.all()] == [(reset.id, 0)]
        log = await manager.all()[0].log()
        assert not log.inputs
        with pytest.raises(SessionNotFoundError):
            manager.get("0" * 32)


async def test_a_fork_is_kept_by_itself(tmp_path: Path) -> None:
    async with _service(tmp_path) as manager:
        session = await manager.create(SOURCE)
        await _story(session)
        fork = await manager.fork(session.id)
        await fork.advance(11)
        digests = {one.id: await _digest(one) for one in (session, fork)}
    async with _service(tmp_path) as manager:
        assert {one.id: await _digest(one) for one in manager.all()} == digests
        fork = max(manager.all(), key=lambda one: one.view.frame)
        # The log of a fork tells what acted on its origin, too.
        again = await manager.replay(await fork.log())
        assert (again.notice, await _digest(again)) == (None, digests[fork.id])


@pytest.mark.parametrize("case", CASES)
async def test_a_log_is_computed_again_to_the_same_bits(case: str) -> None:
    async with _service(None) as manager:
        session = await manager.create(SceneSource(data=CASES[case][0]), choice=CASES[case][1])
        await _story(session)
        log = await session.log()
        again = await manager.replay(log)
        assert (again.view.frame, again.notice) == (60, None)
        assert await again.log() == log
        assert (await again.log()).inputs == log.inputs
        assert await _digest(again, 25) == await _digest(session, 25)


async def test_a_log_of_another_version_is_played_and_says_what_is_not_promised() -> None:
    async with _service(None) as manager:
        session = await manager.create(SOURCE)
        await session.advance(10)
        log = await session.log()
        older = log.origin.versions.model_copy(update={"solver": 3})
        foreign = dataclasses.replace(
            log, origin=dataclasses.replace(log.origin, versions=older), digest="0" * 64
        )
        again = await manager.replay(foreign)
        assert again.view.frame == 10
        assert again.notice is not None
        assert "computed by version 3 of the solver" in again.notice
        changed = await manager.replay(dataclasses.replace(log, digest="0" * 64))
        assert changed.notice is not None
        assert "the log was changed" in changed.notice


async def test_a_session_of_another_version_is_computed_again_from_frame_0(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("hybridmpm_service.sessions.inputs.SOLVER_VERSION", 3)
        async with _service(tmp_path) as manager:
            await _story(await manager.create(SOURCE))
    async with _service(tmp_path) as manager:
        (session,) = manager.all()
        assert session.view.frame == 60
        assert session.notice is not None
        assert (
            "may differ from its former state: it was computed by version 3 of the solver" in session.notice
        )


async def test_a_disk_that_cannot_be_written_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal, "_RETRY_SECONDS", 0.0)
    monkeypatch.setattr(journal, "CHECKPOINT_SECONDS", 1e9)
    full = [False]
    insert = session_file._insert

    def failing(*arguments: Any) -> None:
        if full[0]:
            raise OSError(28, "No space left on device")
        insert(*arguments)

    monkeypatch.setattr(session_file, "_insert", failing)
    async with _service(tmp_path) as manager:
        session = await manager.create(SOURCE)
        full[0] = True
        await _story(session)
        assert session.kept == "failing"
        full[0] = False
        await session.advance(1)
        assert session.kept == "disk"
        expected = await _digest(session)
    async with _service(tmp_path) as manager:
        (session,) = manager.all()
        assert await _digest(session) == expected
        assert (await manager.replay(await session.log())).notice is None


async def test_a_session_that_cannot_be_kept_from_the_start_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with _service(tmp_path, max_sessions=1) as manager:
        monkeypatch.setattr(session_file, "_TABLES", ["CREATE nonsense"])
        with pytest.raises(StorageError, match="cannot be read or written"):
            await manager.create(SOURCE)
        assert manager.all() == []
        assert manager.why_full() is None
        assert _files(tmp_path) == []


async def test_a_hand_that_pushed_lets_go_once_and_for_all(tmp_path: Path) -> None:
    """Its end acts, so it is an input: the next crash must not bring the push back."""
    async with _service(tmp_path / "live") as manager:
        session = await manager.create(SOURCE)
        await session.advance(5)
        made = hand_input(5, push((0.5, 0.4), (1.0, 0.0), 0.1))
        # The process is killed after the input was written, and before its frame.
        session.simulation.journal.add(made)
        _killed(tmp_path / "live", tmp_path / "killed")
    async with _service(tmp_path / "killed") as manager:
        (session,) = manager.all()
        await session.advance(20)
        log = await session.log()
        assert [(one.frame, one.push is None) for one in log.inputs] == [(5, False), (5, True)]  # type: ignore[union-attr]
        _killed(tmp_path / "killed", tmp_path / "again")
    async with _service(tmp_path / "again") as manager:
        (session,) = manager.all()
        assert (session.notice, await _digest(session)) == (None, log.digest)


async def test_a_fork_that_has_computed_nothing_keeps_its_sketch(tmp_path: Path) -> None:
    async with _service(tmp_path / "live") as manager:
        session = await manager.create(SOURCE)
        await session.steer(ARROW, most=400, frames=20)
        fork = await manager.fork(session.id)
        _killed(tmp_path / "live", tmp_path / "left")
        digest = await _digest(fork, 9)
    async with _service(tmp_path / "left") as manager:
        assert [await _digest(session, 9) for session in manager.all()] == [digest] * 2


async def test_a_number_is_never_given_to_two_sketches(tmp_path: Path) -> None:
    async with _service(tmp_path) as manager:
        session = await manager.create(SOURCE)
        assert (await session.steer(ARROW, most=400, frames=20)).number == 1
        await session.release()
    async with _service(tmp_path) as manager:
        (session,) = manager.all()
        assert (await session.steer(ARROW, most=400, frames=20)).number == 2


async def test_frames_of_one_call_are_kept_while_it_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A restart computes again at most what was computed since the latest checkpoint."""
    monkeypatch.setattr(journal, "CHECKPOINT_SECONDS", 0.0)
    checked: list[int] = []
    check = session_file.SessionFile.check

    def noted(self: session_file.SessionFile, checkpoint: session_file.Checkpoint, pending: int = 0) -> None:
        checked.append(checkpoint.frame)
        check(self, checkpoint, pending)

    monkeypatch.setattr(session_file.SessionFile, "check", noted)
    async with _service(tmp_path) as manager:
        await (await manager.create(SOURCE)).advance(20)
        assert checked == list(range(1, 21))


async def test_a_session_that_rests_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal, "CHECKPOINT_SECONDS", 1e9)
    async with _service(tmp_path / "live") as manager:
        session = await manager.create(SOURCE)
        await session.advance(5)
        simulation = session.simulation
        await until(lambda: not simulation.journal.is_behind(simulation.computed_seconds, resting=True))
        _killed(tmp_path / "live", tmp_path / "left")
    async with _service(tmp_path / "left") as manager:
        (session,) = manager.all()
        assert (session.view.frame, session.simulation.computed_seconds) == (5, 0.0)


async def test_computing_again_from_frame_0_goes_on_where_it_was_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each attempt ends at the next input, and begins at the last one: there are checkpoints."""
    monkeypatch.setattr(journal, "CHECKPOINT_SECONDS", 0.0)
    attempts: list[tuple[int, str]] = []
    act = Simulation.act

    def interrupted(self: Simulation, one: Any, guidance: Any = None) -> None:
        met = (one.frame, one.kind) in attempts
        attempts.append((one.frame, one.kind))
        if not met:
            raise SimulationError("interrupted")
        act(self, one, guidance)

    with monkeypatch.context() as patch:
        patch.setattr("hybridmpm_service.sessions.inputs.SOLVER_VERSION", 3)
        async with _service(tmp_path) as manager:
            session = await manager.create(SOURCE)
            await _story(session)
            # Other sessions are there without waiting for this one.
            await manager.create(SOURCE)
    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "act", interrupted)
        for _ in range(7):
            async with _service(tmp_path) as manager:
                assert len(manager.all()) in (1, 2)
    assert [frame for frame, _ in attempts] == [5, 5, 12, 12, 18, 18, 21, 21, 21, 21, 21, 30, 30]
    # Nothing is computed again after that, and the remark stays.
    for _ in range(2):
        async with _service(tmp_path) as manager:
            session = manager.all()[0]
            assert session.view.frame == 60
            assert "may differ from its former state" in str(session.notice)
            assert (await manager.replay(await session.log())).notice is None


async def test_a_creation_that_was_killed_leaves_nothing(tmp_path: Path) -> None:
    part = tmp_path / f"{1:032x}.new"
    part.write_bytes(b"begun")
    async with _service(tmp_path):
        pass
    assert not part.exists()


async def test_a_session_is_not_there_before_it_is_computed_again(tmp_path: Path) -> None:
    async with _service(tmp_path) as manager:
        name = (await manager.create(SOURCE)).id

    manager = SessionManager(Settings(state_folder=str(tmp_path), max_load=64.0))
    with pytest.raises(UnavailableError, match="computed again after a restart"):
        manager.get(name)
    await manager.revive()
    assert manager.get(name).view.frame == 0
    await manager.close()


async def test_sessions_stay_in_their_order(tmp_path: Path) -> None:
    async with _service(tmp_path) as manager:
        names = [(await manager.create(SOURCE)).id for _ in range(4)]
        # A file that changes last is not the newest session.
        await manager.get(names[0]).advance(3)
    async with _service(tmp_path) as manager:
        names.append((await manager.create(SOURCE)).id)
        assert [session.id for session in manager.all()] == names


async def test_two_services_do_not_share_a_folder(tmp_path: Path) -> None:
    async with _service(tmp_path):
        with pytest.raises(ConfigError, match=r"state_folder: .* no other service uses"):
            SessionManager(Settings(state_folder=str(tmp_path)))
    # It is free again.
    async with _service(tmp_path):
        pass


async def test_more_inputs_than_are_kept_cost_the_log_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal, "MAX_INPUTS", 4)
    async with _service(tmp_path) as manager:
        session = await manager.create(SOURCE)
        await _story(session)
        positions = (await session.particles()).positions
        with pytest.raises(Exception, match="no longer has a log; a reset begins a new one"):
            await session.log()
    async with _service(tmp_path) as manager:
        (session,) = manager.all()
        assert np.array_equal((await session.particles()).positions, positions)
        with pytest.raises(Exception, match="no longer has a log"):
            await session.log()
        await session.reset()
        assert (await session.log()).frame == 0


async def test_the_replay_of_a_cancelled_call_ends() -> None:
    async with _service(None, max_sessions=2) as manager:
        session = await manager.create(SOURCE)
        log = dataclasses.replace(await session.log(), frame=100_000)
        replaying = asyncio.create_task(manager.replay(log))
        await asyncio.sleep(0.1)
        replaying.cancel()
        with pytest.raises(asyncio.CancelledError):
            await replaying
        await until(lambda: not manager._being_made)
        assert manager.all() == [session]

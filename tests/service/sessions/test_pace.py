"""The player keeps to media time, and to what the machine can compute beside others."""

import asyncio
import itertools
from collections.abc import Callable
from typing import Any

import pytest
from tests.service.conftest import SCENE, SOURCE
from tests.service.sessions.conftest import Manage

from hybridmpm_service.errors import MachineFullError
from hybridmpm_service.sessions.admission import estimated_frame_seconds
from hybridmpm_service.sessions.player import MAX_LAG_SECONDS, Machine, Pace, Player
from hybridmpm_service.sessions.simulation import Simulation


def _pace(speed: float = 1.0) -> Pace:
    pace = Pace(0.0025, speed)
    pace.start(100.0)
    return pace


def test_even_a_very_slow_player_is_never_owed_less_than_a_frame() -> None:
    pace = Pace(10.0, 0.01)
    pace.start(0.0)
    assert pace.due(5000.0) == 1


def test_the_wait_ends_when_the_next_frame_is_due() -> None:
    pace = _pace(0.01)
    wait = pace.wait(100.0)
    assert wait == pytest.approx(0.25)
    assert pace.due(100.0 + wait - 1e-3) == 0
    assert pace.due(100.0 + wait) == 1


def test_a_new_speed_begins_without_a_jump() -> None:
    pace = _pace(0.25)
    pace.count(pace.due(100.05))
    pace.set_speed(1.0, 100.05)
    assert pace.due(100.05) == 0
    assert pace.due(100.06) == 4


FRAME_DT = 0.0025


def _play(
    monkeypatch: pytest.MonkeyPatch, seconds: float, cost: Callable[[float], float], speed: float
) -> list[tuple[float, int]]:
    """Let a player play on a clock that only sleeping and computing turn.

    `cost` is the time that a frame takes [s] when it begins at a time. Returns the times at which turns
    ended, when viewers get a frame, and the numbers of frames that had been computed then.
    """
    now, frames = 0.0, 0
    turns: list[tuple[float, int]] = []
    end = asyncio.CancelledError()

    async def compute(owed: int, go_on: Callable[[], bool]) -> int:
        nonlocal now, frames
        done = 0
        while done < owed and go_on():
            now += cost(now)
            done += 1
        frames += done
        turns.append((now, frames))
        return done

    async def sleep(duration: float) -> None:
        nonlocal now
        now += duration
        if now >= seconds:
            raise end

    monkeypatch.setattr("hybridmpm_service.sessions.player.asyncio.sleep", sleep)

    async def scene() -> None:
        player = Player(
            FRAME_DT,
            lambda: now,
            machine=Machine(1.0, threads=1),
            frame_seconds=lambda: 0.001,
            compute=compute,
            hurried=lambda: False,
            on_fault=lambda: None,
        )
        player.set_speed(speed)
        player.start()
        await player.run()

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(scene())
    return turns


@pytest.mark.parametrize("speed", [1.0, 0.25, 0.037])
def test_media_time_does_not_drift_in_ten_minutes(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    rate = speed / FRAME_DT
    for time, frames in _play(monkeypatch, 600.0, lambda _: 0.0008, speed):
        assert -0.026 * rate - 1 <= frames - time * rate <= 1e-6
    assert frames == pytest.approx(600.0 * rate, abs=0.03 * rate + 1)


def test_late_frames_are_skipped_and_never_pile_up(monkeypatch: pytest.MonkeyPatch) -> None:
    stall = (5.0, 8.0)
    turns = _play(monkeypatch, 20.0, lambda now: 3.0 if stall[0] <= now < stall[1] else 0.0008, 1.0)
    # Before and after three lost seconds, frames come at the same pace; the seconds are not made up for.
    assert [frames for time, frames in turns if time < stall[0]][-1] == pytest.approx(2000, abs=12)
    assert turns[-1][1] == pytest.approx((20.0 - 3.0) * 400, abs=2 * MAX_LAG_SECONDS * 400)
    after = [(time, frames) for time, frames in turns if time > stall[1] + 0.5]
    for (earlier, before), (later, now) in itertools.pairwise(after):
        assert now - before <= (later - earlier + 0.02) * 400


def test_a_machine_that_is_too_slow_shows_frames_often_and_slowly(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = _play(monkeypatch, 60.0, lambda _: 0.005, 1.0)
    assert turns[-1][1] == pytest.approx(60.0 / 0.005, rel=0.05)
    gaps = [later - earlier for (earlier, _), (later, _) in itertools.pairwise(turns)]
    assert max(gaps) < 0.05


QUARTER = 0.25 / SCENE.frame_dt
"""Frames a second at the speed of a new session."""


class _Load:
    def __init__(self, load: float, owner: str = "") -> None:
        self.load, self.owner = load, owner


def test_a_load_is_the_time_of_the_frames_in_a_second_and_at_most_all_threads() -> None:
    machine = Machine(2.0, threads=3)
    assert machine.load_of(0.001, 0.0025, 0.25) == pytest.approx(3 * 0.1)
    assert machine.load_of(1.0, 0.0025, 0.25) == 3.0


def test_there_is_room_up_to_the_cores_and_always_for_one_who_plays_alone() -> None:
    machine, first, second = Machine(2.0, threads=1), _Load(0.0), _Load(0.0)
    machine.join(first)
    machine.join(second)
    machine.check(5.0, "a giant")
    first.load = 1.5
    machine.check(0.5, "a session")
    with pytest.raises(MachineFullError, match=r"1\.50 of 2 cores, and a session would take about 0\.60"):
        machine.check(0.6, "a session")
    machine.check(0.6, "the first", first)
    assert machine.full() is None
    second.load = 0.5
    assert isinstance(machine.full(), MachineFullError)
    machine.leave(first)
    machine.check(0.6, "a session")


@pytest.fixture
def costs(monkeypatch: pytest.MonkeyPatch) -> dict[Any, float]:
    """Return what frames of simulations cost [s]; nothing is computed."""
    made: dict[Any, float] = {}
    monkeypatch.setattr(Simulation, "frame_seconds", property(made.get))
    monkeypatch.setattr(Simulation, "advance", lambda *_: 0)
    return made


@pytest.mark.anyio
async def test_a_paused_session_costs_nothing_and_is_asked_again_when_it_plays(
    manage: Manage, costs: dict[Any, float]
) -> None:
    manager = manage(max_load=1.0)
    sessions = [await manager.create(SOURCE) for _ in range(4)]
    for session in sessions:
        costs[session.simulation] = 0.6 / QUARTER
    first, second, *others = sessions
    first.play()
    for waiting in (second, *others):
        with pytest.raises(MachineFullError, match=r"this session would take about 0\.60"):
            waiting.play()
        assert not waiting.playing
    first.pause()
    second.play()
    assert second.playing


@pytest.mark.anyio
async def test_whoever_plays_may_go_slower_but_not_faster_than_there_is_time_for(
    manage: Manage, costs: dict[Any, float]
) -> None:
    manager = manage(max_load=1.0)
    first, second = await manager.create(SOURCE), await manager.create(SOURCE)
    for session in (first, second):
        costs[session.simulation] = 0.3 / QUARTER
        session.play()
    with pytest.raises(MachineFullError, match="at that speed"):
        first.set_speed(1.0)
    assert first.speed == 0.25
    second.set_speed(0.1)
    first.set_speed(0.5)
    assert first.load == pytest.approx(0.6)
    # Who is paused chooses freely, and is asked when it plays.
    second.pause()
    second.set_speed(1.0)
    with pytest.raises(MachineFullError):
        second.play()


@pytest.mark.anyio
async def test_a_session_costs_its_estimate_until_its_first_frame_and_a_fork_what_its_origin_costs(
    manage: Manage, costs: dict[Any, float]
) -> None:
    manager = manage(max_load=1.0)
    session = await manager.create(SOURCE)
    assert session.frame_seconds == estimated_frame_seconds(SCENE)
    costs[session.simulation] = 0.002
    session.set_speed(0.5)
    fork = await manager.fork(session.id)
    assert (fork.frame_seconds, fork.speed, fork.playing) == (0.002, 0.5, False)
    costs[fork.simulation] = 0.003
    assert fork.frame_seconds == 0.003

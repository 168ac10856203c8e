"""Who may play beside others, decided by costs that the test makes up."""

from typing import TYPE_CHECKING, Any

import pytest
from tests.service.conftest import SCENE, SOURCE
from tests.service.sessions.conftest import Manage

from hybridmpm_service.errors import MachineFullError
from hybridmpm_service.sessions.admission import estimated_frame_seconds
from hybridmpm_service.sessions.player import Machine
from hybridmpm_service.sessions.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from hybridmpm_service.sessions.session import Session

QUARTER = 0.25 / SCENE.frame_dt
"""Frames a second at the speed of a new session."""


class _Load:
    def __init__(self, load: float) -> None:
        self.load = load


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
async def test_a_full_machine_refuses_new_sessions_and_forks_and_lets_those_that_play_play_on(
    manage: Manage, costs: dict[Any, float]
) -> None:
    manager = manage(max_load=2.0)
    first, second = (
        await manager.create(SOURCE),
        await manager.create(SOURCE),
    )
    for session in (first, second):
        session.play()
        costs[session.simulation] = 0.9 / QUARTER
    assert first.load == pytest.approx(0.9)
    assert 0.0 < estimated_frame_seconds(SCENE) * QUARTER < 0.1
    await manager.delete((await manager.create(SOURCE)).id)
    costs[first.simulation] = 1.2 / QUARTER
    costs[second.simulation] = 1.0 / QUARTER
    refused: list[Callable[[], Awaitable[Session]]] = [
        lambda: manager.create(SOURCE),
        lambda: manager.fork(first.id),
    ]
    for attempt in refused:
        with pytest.raises(MachineFullError, match=r"take 2\.00 of 2 cores"):
            await attempt()
    assert isinstance(manager.why_full(), MachineFullError)
    assert [session.playing for session in manager.all()] == [True, True]


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
    first, second = (
        await manager.create(SOURCE),
        await manager.create(SOURCE),
    )
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

"""Turns and work apart: who runs, who waits, and how everything ends. No test depends on a clock."""

import asyncio
import os
import signal
import threading
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from tests.service.conftest import WAIT_SECONDS, until

from hybridmpm import Ball, BallObstacle, Scene, SceneError
from hybridmpm.scene import Motion
from hybridmpm_service import Settings
from hybridmpm_service.errors import UnavailableError, WorkTooLongError
from hybridmpm_service.sessions import turns as module
from hybridmpm_service.sessions.admission import within_limits
from hybridmpm_service.sessions.apart import run_apart
from hybridmpm_service.sessions.turns import CLIENT, Client, Turn, Turns

pytestmark = pytest.mark.anyio


_computed: defaultdict[int, float] = defaultdict(float)
"""Time that each thread has computed, as the steps of `_Long` count it [s]."""


@pytest.fixture
async def turns(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Turns]:
    """Return turns, of which one at a time runs unless a test gives another number."""

    def clock() -> Callable[[], float]:
        thread = threading.get_ident()
        return lambda: _computed[thread]

    monkeypatch.setattr(module, "thread_clock", clock)
    made = Turns(getattr(request, "param", 1))
    yield made
    made.close(UnavailableError("the test ends"))
    await made.ended()


class _Long:
    """Work of a client that goes on until it is ended."""

    def __init__(self, turns: Turns, client: Client, **settings: Any) -> None:
        self.turn: Turn | None = None
        self.steps = 0
        CLIENT.set(client)
        self.task = asyncio.create_task(self._work(turns, settings))

    async def _work(self, turns: Turns, settings: Any) -> None:
        async with turns.turn(**settings) as self.turn:
            await self.turn.in_thread(lambda: self._step(self.turn))

    def _step(self, turn: Turn | None) -> None:
        while turn is not None:
            turn.check()
            self.steps += 1
            time.sleep(0.001)
            _computed[threading.get_ident()] += 0.001

    async def end(self) -> None:
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


async def test_short_work_of_another_client_does_not_wait_for_the_long_work_of_many(turns: Turns) -> None:
    long = [_Long(turns, Client("a", port)) for port in range(20)]
    await until(lambda: long[0].steps > 10)
    for bystander in (Client("b", 1), Client("a", 100)):
        CLIENT.set(bystander)
        assert await turns.run(threading.get_ident) != threading.get_ident()
    assert not any(one.task.done() for one in long)
    for one in long:
        await one.end()


async def test_clients_have_equal_shares_however_much_they_ask_for(turns: Turns) -> None:
    greedy = [_Long(turns, Client("a", port)) for port in range(5)]
    modest = _Long(turns, Client("b", 1))
    await until(lambda: modest.turn is not None and modest.turn.spent > 0.5)
    spent = sum(one.turn.spent for one in greedy if one.turn is not None)
    assert 0.3 < modest.turn.spent / (modest.turn.spent + spent) < 0.7
    for one in (*greedy, modest):
        await one.end()


async def test_short_work_does_not_wait_for_the_long_work_of_equals(
    monkeypatch: pytest.MonkeyPatch, turns: Turns
) -> None:
    """Each of the others has had less time than the client whose work is short."""
    now = time.monotonic()
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now))

    def compute() -> None:
        _computed[threading.get_ident()] += 0.09

    CLIENT.set(Client("a", 100))
    await turns.run(compute)
    long = [_Long(turns, Client("a", port), short=False) for port in range(20)]
    await until(lambda: long[0].steps)
    CLIENT.set(Client("a", 100))
    await turns.run(lambda: None)
    assert long[1].turn is None
    slow = _Long(turns, Client("a", 100))
    await until(lambda: slow.turn is not None and slow.steps > 100 and not slow.turn.running)
    await turns.run(lambda: None)
    for one in (*long, slow):
        await one.end()


async def test_work_is_short_by_what_a_core_computes_however_busy_the_machine(
    monkeypatch: pytest.MonkeyPatch, turns: Turns
) -> None:
    now, begun, end = time.monotonic(), threading.Event(), threading.Event()
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now))

    def wait_for_a_core() -> None:
        begun.set()
        assert end.wait(WAIT_SECONDS)

    async with turns.turn() as turn:
        working = asyncio.create_task(turn.in_thread(wait_for_a_core))
        await until(begun.is_set)
        now += 10.0
        turns._decide()
        assert (turn.short, turn.running, turn.spent) == (True, True, 0.0)
        end.set()
        await working


async def test_work_in_the_background_lets_other_work_of_its_connection_pass(turns: Turns) -> None:
    jobs = [_Long(turns, Client("a", 1), background=True) for _ in range(2)]
    await until(lambda: jobs[0].steps > 10)
    await turns.run(lambda: None)
    assert jobs[1].turn is None, "jobs of a connection follow each other"
    for one in jobs:
        await one.end()


@pytest.mark.parametrize("turns", [5], indirect=True)
async def test_the_memory_of_started_work_is_bounded(monkeypatch: pytest.MonkeyPatch, turns: Turns) -> None:
    monkeypatch.setattr(module, "MAX_MEMORY", 100)
    monkeypatch.setattr(module, "HEAVY", 10)
    first = _Long(turns, Client("a", 1), memory=60)
    await until(lambda: first.steps)
    second = _Long(turns, Client("b", 1), memory=50)
    third = _Long(turns, Client("c", 1), memory=40)
    other = _Long(turns, Client("c", 2), memory=20)
    await until(lambda: third.steps)
    await turns.run(lambda: None)  # light work has no part in it
    assert second.turn is None
    assert other.turn is None, "an address has at most half"
    await first.end()
    await until(lambda: second.steps)
    for one in (second, third, other):
        await one.end()


async def test_whoever_waits_too_much_is_refused_and_leaves_room_for_others(
    monkeypatch: pytest.MonkeyPatch, turns: Turns
) -> None:
    monkeypatch.setattr(module, "MAX_TURNS", 4)
    greedy = [_Long(turns, Client("a", port)) for port in range(4)]
    await until(lambda: greedy[0].steps)
    with pytest.raises(UnavailableError, match="wait already"):
        await turns.run(lambda: None)
    CLIENT.set(Client("b", 1))
    await turns.run(lambda: None)
    with pytest.raises(UnavailableError, match="wait already"):
        await greedy[3].task
    assert turns.why_stuck() is None
    monkeypatch.setattr(module, "STUCK_SECONDS", -1.0)
    assert "waiting" in str(turns.why_stuck())
    for one in greedy:
        await one.end()


async def test_a_process_apart_gives_its_result_or_its_error() -> None:
    assert await run_apart(os.getpid) != os.getpid()
    with pytest.raises(FileNotFoundError):
        await run_apart(os.stat, "/nowhere")


def _gone(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return True
    return state.rpartition(")")[2].split()[0] == "Z"


@pytest.mark.parametrize("end", ["client", "stop", "crash"])
async def test_a_process_apart_ends_with_its_client_and_with_the_server(end: str, turns: Turns) -> None:
    """The process sleeps in one call, and would do so for an hour."""

    async def work() -> None:
        async with turns.turn() as turn:
            found.append(turn)
            await turn.apart(time.sleep, 3600)

    found: list[Turn] = []
    working = asyncio.create_task(work())
    await until(lambda: found and found[0]._pid)
    pid = found[0]._pid
    assert not _gone(pid)
    if end == "client":
        working.cancel()
        with pytest.raises(asyncio.CancelledError):
            await working
    elif end == "stop":
        turns.close(UnavailableError("the server stops"))
        with pytest.raises(UnavailableError, match="stops"):
            await working
    else:
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(WorkTooLongError):
            await working
    await until(lambda: _gone(pid))


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
async def test_a_process_apart_is_paused_while_others_have_precedence(turns: Turns) -> None:

    async def work() -> None:
        async with turns.turn() as turn:
            found.append(turn)
            await turn.apart(time.sleep, 3600)

    def stopped() -> bool:
        return Path(f"/proc/{found[0]._pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"

    found: list[Turn] = []
    CLIENT.set(Client("a", 1))
    working = asyncio.create_task(work())
    await until(lambda: found and found[0]._pid and found[0].spent > 0.05)
    other = _Long(turns, Client("b", 1))
    await until(stopped)
    await other.end()
    await until(lambda: not stopped())
    working.cancel()
    await asyncio.gather(working, return_exceptions=True)


def _scene(count: int, resolution: int, dim: int = 2, motion: Motion | None = None) -> Scene:
    obstacle = BallObstacle(center=(0.5,) * dim, radius=0.05, motion=motion)
    body = Ball(center=(0.3,) * dim, radius=0.02, material="water")
    return Scene(dim=dim, resolution=resolution, bodies=(body,), obstacles=(obstacle,) * count)


@pytest.mark.parametrize(
    "scene",
    [
        _scene(1000, 1024),
        _scene(1000, 160, 3),
        _scene(40, 160, 3),
        _scene(1000, 1024, motion=Motion(velocity=(0.1, 0.0))),
        _scene(30, 160, 3, motion=Motion(angular_velocity=(1.0, 1.0, 1.0), center=(0.5, 0.5, 0.5))),
    ],
)
def test_what_obstacles_cost_is_refused_before_it_is_paid(scene: Scene) -> None:
    with pytest.raises(SceneError, match=r"max_(building|frame)_cost"):
        within_limits(scene, Settings())


@pytest.mark.parametrize(
    "scene", [_scene(20, 256), _scene(20, 64, 3), _scene(3, 128, 3, motion=Motion(velocity=(1.0, 0.0, 0.0)))]
)
def test_usual_numbers_of_obstacles_are_taken(scene: Scene) -> None:
    assert within_limits(scene, Settings()).obstacles == scene.obstacles

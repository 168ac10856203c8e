"""Threads that compute take turns in the order in which they come."""

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from hybridmpm import Box, Scene
from hybridmpm_service import Settings
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.sessions.turns import Turns

SCENE = Scene(dim=2, resolution=32, bodies=(Box(lower=(0.4, 0.4), upper=(0.6, 0.6), material="water"),))


def test_who_comes_again_at_once_waits_for_the_others() -> None:
    turns, order = Turns(1), list[str]()
    come, others = threading.Event(), threading.Barrier(2)

    def often() -> None:
        for index in range(4):
            with turns:
                if index == 0:
                    come.set()
                    others.wait()
                    # The other one now stands in line: it has nothing else to do.
                    while not turns._line:
                        pass
                order.append("often")

    def once() -> None:
        come.wait()
        others.wait()
        with turns:
            order.append("once")

    with ThreadPoolExecutor(2) as pool:
        for one in (pool.submit(often), pool.submit(once)):
            one.result(timeout=30)
    assert order == ["often", "once", "often", "often", "often"]


def test_so_many_are_in_at_a_time() -> None:
    turns, inside, most = Turns(2), list[int](), list[int]()

    def stay(number: int) -> None:
        for _ in range(50):
            with turns:
                inside.append(number)
                most.append(len(inside))
                inside.remove(number)

    with ThreadPoolExecutor(5) as pool:
        list(pool.map(stay, range(5)))
    assert max(most) <= 2
    assert len(most) == 250
    with pytest.raises(ZeroDivisionError), turns:
        _ = 1 // 0
    with turns, turns:
        assert turns._free == 0


def test_a_long_call_gives_way_to_another_session() -> None:
    async def scene() -> None:
        manager = SessionManager(Settings(max_load=64.0))
        manager._machine.turns = Turns(1)
        try:
            first, second = [await manager.create(lambda: SCENE) for _ in range(2)]
            long = asyncio.create_task(first.advance(2000))
            await _until(lambda: first.simulation.frame > 0)
            await second.advance(3)
            assert not long.done()
            assert first.simulation.frame < 2000
            long.cancel()
        finally:
            await manager.close()

    asyncio.run(scene())


async def _until(happens: Callable[[], bool]) -> None:
    async with asyncio.timeout(30):
        while not happens():  # noqa: ASYNC110 - what it waits for has no event
            await asyncio.sleep(0.001)

"""Rounds of the event loop: a piece in each, in turn between addresses and their connections."""

import asyncio

import pytest
from tests.service.conftest import until

from hybridmpm_service.http import rounds as module
from hybridmpm_service.http.rounds import Rounds
from hybridmpm_service.sessions.turns import Client

pytestmark = pytest.mark.anyio


async def test_a_crowd_takes_turns_with_others_and_its_new_connections_count_as_one() -> None:
    rounds, done = Rounds(), list[str]()

    def add(client: Client, count: int, name: str) -> None:
        for number in range(count):
            rounds.do(client, lambda number=number: done.append(f"{name}{number}"))  # type: ignore[misc]

    add(Client("crowd"), 104, "new")
    add(Client("crowd", 1), 2, "known")
    add(Client("crowd", 2), 1, "third")
    add(Client("other", 1), 2, "other")
    await until(lambda: len(done) == 109)
    assert done[0] == "new0", "the first one does not wait"
    waiting = ["new1", "other0", "known0", "other1", "new2", "third0", "new3", "known1"]
    assert done[1:] == [*waiting, *(f"new{number}" for number in range(4, 104))]


async def test_other_things_happen_between_the_rounds() -> None:
    rounds, done = Rounds(), list[int]()
    for number in range(10 * module._AT_ONCE):
        rounds.do(Client("a", number), lambda number=number: done.append(number))  # type: ignore[misc]
    counts = []
    while len(done) < 10 * module._AT_ONCE:
        counts.append(len(done))
        await asyncio.sleep(0)
    assert counts == [module._AT_ONCE * count for count in range(1, 10)]
    await asyncio.gather(*(rounds.turn(Client("a")) for _ in range(2 * module._AT_ONCE)))


async def test_a_piece_that_fails_ends_no_other() -> None:
    def fail() -> None:
        raise RuntimeError

    rounds, done, faults = Rounds(), list[int](), list[object]()
    asyncio.get_running_loop().set_exception_handler(lambda _loop, context: faults.append(context))
    for work in (*([lambda: None] * module._AT_ONCE), fail, lambda: done.append(1)):
        rounds.do(Client("a"), work)
    await until(lambda: done)
    assert len(faults) == 1

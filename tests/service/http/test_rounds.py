"""Rounds of the event loop: a piece in each, in turn between addresses and their connections."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from tests.service.conftest import until
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from hybridmpm_service.http import rounds as module
from hybridmpm_service.http.connection import StreamProtocol
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


async def test_bytes_of_a_stream_are_read_in_order_though_new_ones_come_while_pieces_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Protocol(StreamProtocol):
        rate, burst = 10.0, 10

        def __init__(self) -> None:
            self.rounds, self.client = Rounds(), ("a", 1)
            self._unread, self._flooded, self.read_paused = bytearray(), False, False
            self.transport: Any = SimpleNamespace(
                is_closing=lambda: False,
                pause_reading=lambda: states.append("paused"),
                resume_reading=lambda: states.append("reads"),
            )

    states, seen = list[str](), list[bytes]()
    monkeypatch.setattr(WebSocketsSansIOProtocol, "data_received", lambda _self, data: seen.append(data))
    protocol = Protocol()
    sent = [bytes([number]) * size for number, size in enumerate((3000, 10, 2048, 1, 5000))]
    for data in sent:
        protocol.data_received(data)
        assert states[-1] == "paused"
        await asyncio.sleep(0)
    total = b"".join(sent)
    await until(lambda: sum(map(len, seen)) == len(total))
    assert b"".join(seen) == total
    assert max(map(len, seen)) <= 1024
    assert states[-1] == "reads"

    async def received(self: WebSocketsSansIOProtocol) -> Any:
        self.transport.resume_reading()
        return "message"

    # A message that the application takes makes uvicorn read on, though pieces wait.
    monkeypatch.setattr(WebSocketsSansIOProtocol, "receive", received)
    protocol.data_received(bytes(3000))
    assert await protocol.receive() == "message"
    assert states[-1] == "paused"
    await until(lambda: sum(map(len, seen)) == len(total) + 3000)
    assert await protocol.receive() == "message"
    assert states[-1] == "reads"

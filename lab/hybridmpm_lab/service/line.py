"""How old the frames are that a slow line brings: a viewer behind a throttle, beside one on this machine."""

import asyncio
import socket
from collections.abc import Iterator

import numpy as np

from hybridmpm.client import AsyncClient
from hybridmpm_lab.service.server import Server, running

RATE = 200e3
"""Bytes a second towards the viewer: 1.6 Mbit/s."""
DELAY = 0.075
"""Time of each way [s]."""
_PACKET = 1500
_WINDOW = 8192  # bytes of the system's buffer in front of the throttle
_SPEED = 0.25  # simulated seconds a second, at which sessions play
_WARM_UP = 4.0  # until all buffers on the way are full [s]


def ages(seconds: float) -> Iterator[tuple[str, float, str]]:
    """Yield for two scenes the frames a second that come, and their median age, with their units."""
    for scenario in ("water_2d", "water_3d"):
        with running() as server:
            rate, age = asyncio.run(_watched(server, scenario, seconds))
        yield f"frames that come at 1.6 Mbit/s, 150 ms, {scenario}", rate, "1/s"
        yield f"age of frames at 1.6 Mbit/s, 150 ms, {scenario}, p50", age, "s"


async def _watched(server: Server, scenario: str, seconds: float) -> tuple[float, float]:
    """Watch a session through the throttle; an age is the time since which another viewer has the frame."""
    loop = asyncio.get_running_loop()
    came: dict[int, float] = {}
    found: list[float] = []
    throttle = await asyncio.start_server(lambda *ends: _carry(server, *ends), "127.0.0.1", 0)
    port = throttle.sockets[0].getsockname()[1]
    async with AsyncClient(server.address) as near, AsyncClient(f"http://127.0.0.1:{port}") as far:
        session = await near.create(scenario, 3)
        async with session.stream() as here, (await far.session(session.id)).stream() as there:
            await here.play()

            async def note() -> None:
                async for frame in here.frames():
                    came[frame.number] = loop.time()

            noting = asyncio.create_task(note())
            start = loop.time() + _WARM_UP
            async for frame in there.frames():
                now = loop.time()
                if now > start and frame.number in came:
                    found.append(now - came[frame.number])
                if now > start + seconds:
                    break
            noting.cancel()
            await asyncio.gather(noting, return_exceptions=True)
        await session.delete()
    throttle.close()
    return len(found) / seconds, float(np.median(found))


async def _carry(server: Server, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Carry a connection to the server; what it answers comes late, and no faster than the line."""
    end = socket.socket()
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _WINDOW)
    end.setblocking(False)  # noqa: FBT003 - the name of the argument is not public
    loop = asyncio.get_running_loop()

    def write(to: asyncio.StreamWriter, data: bytes) -> None:
        if not to.is_closing():
            to.write(data)

    await loop.sock_connect(end, ("127.0.0.1", server.port))
    answers, requests = await asyncio.open_connection(sock=end, limit=_PACKET)

    async def down() -> None:
        due = loop.time()
        while data := await answers.read(_PACKET):
            due = max(due, loop.time()) + len(data) / RATE
            await asyncio.sleep(max(0.0, due - loop.time()))
            loop.call_later(DELAY, write, writer, data)

    async def up() -> None:
        while data := await reader.read(_PACKET):
            loop.call_later(DELAY, write, requests, data)

    ways = [asyncio.create_task(way()) for way in (down, up)]
    await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    for way in ways:
        way.cancel()
    await asyncio.gather(*ways, return_exceptions=True)
    for one in (writer, requests):
        one.close()

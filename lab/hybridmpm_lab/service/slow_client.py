"""A client that takes a kilobyte a second, as over a bad line, and connects again and again."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass

from hybridmpm.errors import SimulationError

_BYTES, _SECONDS = 256, 0.25  # It takes so many bytes in each such time
_STAY_SECONDS = 6.0
"""Time after which it leaves and connects anew.

The service drops it after 5 s (setting `send_seconds`), which it would not notice for minutes: the system
still delivers the bytes that were sent before.
"""
_RECEIVE_BUFFER = 4096  # Size of its own buffer [bytes]; the rest stays with the server
_HANDSHAKE = (
    "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@dataclass
class SlowClient:
    """State of a slow client."""

    port: int = 0
    """Its own port at present; 0 while it has none."""
    received: int = 0
    """Bytes that it has taken."""


@asynccontextmanager
async def slowly_watching(server_port: int, path: str) -> AsyncIterator[SlowClient]:
    """Watch the stream of a path on a port of this machine slowly, within the block.

    Raises
    ------
    SimulationError
        The service has refused the client or has sent it nothing; raised at the end of the block.
    """
    client = SlowClient()
    task = asyncio.create_task(_watch(client, server_port, path))
    try:
        yield client
    finally:
        task.cancel()
        (end,) = await asyncio.gather(task, return_exceptions=True)
    if isinstance(end, SimulationError):
        raise end
    if not client.received:
        raise SimulationError("the service sent a slow client nothing; measure for a longer time")


async def _watch(client: SlowClient, server_port: int, path: str) -> None:
    while True:
        with socket.socket() as line:
            # Before it connects, since the size is agreed upon then.
            line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            line.setblocking(False)  # noqa: FBT003 - the only form it has
            with suppress(ConnectionError, TimeoutError):
                async with asyncio.timeout(_STAY_SECONDS):
                    await _take(client, line, server_port, path)
        client.port = 0
        await asyncio.sleep(_SECONDS)


async def _take(client: SlowClient, line: socket.socket, server_port: int, path: str) -> None:
    loop = asyncio.get_running_loop()
    await loop.sock_connect(line, ("127.0.0.1", server_port))
    client.port = line.getsockname()[1]
    request = _HANDSHAKE.format(path=path, port=server_port)
    await loop.sock_sendall(line, request.encode("ascii"))
    answer = await loop.sock_recv(line, _BYTES)
    if answer and not answer.startswith(b"HTTP/1.1 101"):
        raise SimulationError(f"the service refuses a slow client: {answer.splitlines()[0].decode()}")
    while taken := await loop.sock_recv(line, _BYTES):
        client.received += len(taken)
        await asyncio.sleep(_SECONDS)

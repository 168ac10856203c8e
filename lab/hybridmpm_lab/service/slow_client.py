"""A client that takes a kilobyte a second, as behind a bad line, and connects again and again."""

import asyncio
import contextlib
import socket
from types import TracebackType
from typing import Self

from hybridmpm.errors import SimulationError

_BYTES, _SECONDS = 256, 0.25
"""It takes so many bytes in each such time."""
_STAY_SECONDS = 6.0
"""Time after which it leaves and connects anew.

The service drops it after 5 s (setting `send_seconds`), which it would not notice for minutes: the system
goes on handing it what was sent before.
"""
_RECEIVE_BUFFER = 4096
"""Size of its own buffer [bytes]: what does not fit there stays with the server."""
_HANDSHAKE = (
    "GET {path} HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
_ACCEPTED = b"HTTP/1.1 101"
"""Begins the answer to the handshake of a stream that opens."""


class SlowClient:
    """Watches a session slowly within an `async with` block.

    Leaving the block raises a SimulationError where the service has refused it or has sent it nothing.

    Parameters
    ----------
    address : str
        Host and port of the server.
    stream : str
        Path of the stream.
    """

    def __init__(self, address: str, stream: str) -> None:
        self._address, self._path = address, f"{stream}?version=2"
        self.received = 0
        """Bytes of the stream taken so far."""
        self.port = 0
        """Its own port at present; 0 while it has none."""

    async def __aenter__(self) -> Self:
        self._task = asyncio.create_task(self._watch())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._task.cancel()
        (end,) = await asyncio.gather(self._task, return_exceptions=True)
        if isinstance(end, SimulationError):
            raise end
        if not self.received and error is None:
            raise SimulationError("the service sent a slow client nothing; measure for a longer time")

    async def _watch(self) -> None:
        while True:
            with socket.socket() as upsampler:
                # Before it connects, since the size is agreed upon then.
                upsampler.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
                upsampler.setblocking(False)  # noqa: FBT003 - the only form it has
                with contextlib.suppress(ConnectionError, TimeoutError):
                    async with asyncio.timeout(_STAY_SECONDS):
                        await self._take(upsampler)
            self.port = 0
            await asyncio.sleep(_SECONDS)

    async def _take(self, upsampler: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        host, _, port = self._address.partition(":")
        await loop.sock_connect(upsampler, (host, int(port)))
        self.port = upsampler.getsockname()[1]
        request = _HANDSHAKE.format(path=self._path, address=self._address)
        await loop.sock_sendall(upsampler, request.encode("ascii"))
        answer = await loop.sock_recv(upsampler, _BYTES)
        if answer and not answer.startswith(_ACCEPTED):
            raise SimulationError(f"the service answers a slow client {answer.splitlines()[0].decode()}")
        while taken := await loop.sock_recv(upsampler, _BYTES):
            self.received += len(taken)
            await asyncio.sleep(_SECONDS)

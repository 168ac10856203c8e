"""Viewers of a service: many in one process, which record when frames arrive and decode few of them.

With `AsyncClient.stream` in their place 100 viewers take 1.7 times the processor time, from the server on the
same machine.
"""

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from hybridmpm.client import AsyncClient, AsyncSession
from hybridmpm.errors import SimulationError
from hybridmpm.stream_frames import Frame, decode
from hybridmpm_lab.harness.rows import Row

WAIT = 60.0
"""Longest time to wait for anything of the server [s]; a server that takes longer has failed."""


class Viewer:
    """One viewer of a session, on an open stream of a path on the server.

    Methods raise a `SimulationError` where the server has closed the stream or has refused a command.
    """

    def __init__(self, stream: ClientConnection, path: str) -> None:
        self._stream, self.path = stream, path
        self._expected: tuple[Callable[[Frame], bool], asyncio.Future[float]] | None = None
        self.task = asyncio.create_task(self._watch())
        self.forget()

    def forget(self) -> None:
        """Forget the frames so far."""
        self.arrivals: list[float] = []
        """Times at which the frames arrived [s]."""
        self._ends: list[bytes] = []

    @property
    def frames(self) -> int:
        """Number of frames since the last `forget`."""
        return len(self.arrivals)

    async def send(self, kind: str, **values: Any) -> None:
        """Send a command of the player."""
        await self._stream.send(json.dumps({"type": kind} | values))

    def expect(self, shows: Callable[[Frame], bool]) -> asyncio.Future[float]:
        """Return a future of the next frame of a kind: when it arrived [s]."""
        future: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        self._expected = shows, future
        return future

    async def arrival(self, expected: asyncio.Future[float]) -> float:
        """Wait for a frame of `expect`, at most a minute, and return when it arrived [s]."""
        await asyncio.wait((expected, self.task), timeout=WAIT, return_when=asyncio.FIRST_COMPLETED)
        if not expected.done():
            self.check()
            raise SimulationError(f"the service sent no frame of the expected kind within {WAIT:g} s")
        return expected.result()

    def intervals(self) -> np.ndarray:
        """Return the times between successive frames [ms]."""
        self.check()
        if len(self.arrivals) < 2:
            raise SimulationError("a viewer saw fewer than two frames; measure for a longer time")
        return 1e3 * np.diff(self.arrivals)

    def time_scale(self) -> float:
        """Return the simulated seconds per second between the first and the last frame."""
        elapsed = 1e-3 * self.intervals().sum()
        first, last = (decode(message).time for message in self._ends)
        return float((last - first) / elapsed)

    def check(self) -> None:
        """Raise the error that has ended the stream, if any."""
        if self.task.done():
            self.task.result()

    async def _watch(self) -> None:
        try:
            while True:
                message = await self._stream.recv()
                if isinstance(message, bytes):
                    self._note(message)
                elif message.startswith('{"type":"problem"'):
                    raise SimulationError(f"the service answers {message}")
        except ConnectionClosed as error:
            raise SimulationError(f"the service closed a stream: {error}") from None

    def _note(self, message: bytes) -> None:
        now = time.perf_counter()
        self.arrivals.append(now)
        self._ends = [*self._ends[:1], message]
        if self._expected is not None and self._expected[0](decode(message)):
            if not self._expected[1].done():
                self._expected[1].set_result(now)
            self._expected = None


@asynccontextmanager
async def watching(address: str, session: AsyncSession) -> AsyncIterator[Viewer]:
    """Open a stream of a session, and watch it."""
    path = f"/v1/sessions/{session.id}/stream?version=2"
    uri = address.replace("http", "ws", 1) + path
    async with connect(uri, compression=None, proxy=None, close_timeout=1.0) as stream:
        viewer = Viewer(stream, path)
        try:
            yield viewer
        finally:
            viewer.task.cancel()
            await asyncio.gather(viewer.task, return_exceptions=True)


@asynccontextmanager
async def playing(
    address: str, bodies: Sequence[Row], *, viewers: int = 1, speed: float
) -> AsyncIterator[list[Viewer]]:
    """Create sessions that play, yield their viewers session by session, and delete them at the end.

    Parameters
    ----------
    address : str
        Address of the server.
    bodies : sequence of dict
        Arguments of `AsyncClient.create` for each session.
    viewers : int
        Number of viewers of each session.
    speed : float
        Simulated seconds per second.
    """
    async with AsyncClient(address, timeout=WAIT) as client, AsyncExitStack() as stack:
        sessions = [await client.create(**body) for body in bodies]
        each = [session for session in sessions for _ in range(viewers)]
        crowd = [await stack.enter_async_context(watching(address, session)) for session in each]
        for viewer in crowd[::viewers]:
            await viewer.send("speed", value=speed)
            await viewer.send("play")
        for viewer in crowd:
            await viewer.arrival(viewer.expect(lambda _: True))
        yield crowd
        for viewer in crowd:
            viewer.check()
        for session in sessions:
            await session.delete()

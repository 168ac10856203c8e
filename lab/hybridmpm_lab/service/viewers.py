"""Light clients: many viewers in one process, which note when frames arrive and read next to nothing of them.

What a client computes it takes from the server on the same machine.
"""

import asyncio
import json
import struct
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import httpx
import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from hybridmpm.errors import SimulationError

WAIT_SECONDS = 60.0
"""Longest time to wait for anything of the server; one that takes longer has failed."""
_TIME_OFFSET = 16
"""Place of the simulated time [s] in a frame, a little-endian double."""
_PROBLEM = '{"type":"problem"'
"""Begins a message of the server that refuses a command or tells of a frame that failed."""


class Viewer:
    """One viewer of a session, on an open stream.

    Parameters
    ----------
    stream : ClientConnection
        The stream.
    path : str
        Path of the stream on the server.
    """

    def __init__(self, stream: ClientConnection, path: str) -> None:
        self._stream = stream
        self.path = path
        """Path of the stream."""
        self._task = asyncio.create_task(self._watch())
        self._awaited: tuple[Callable[[bytes], bool], asyncio.Future[float]] | None = None
        self.begin()

    def begin(self) -> None:
        """Forget the frames so far."""
        self.arrivals: list[float] = []
        """When each frame arrived [s, of `time.perf_counter`]."""
        self._first: bytes | None = None
        self._last: bytes | None = None

    async def send(self, **command: Any) -> None:
        """Send a command of the player."""
        await self._stream.send(json.dumps(command))

    def expect(self, matches: Callable[[bytes], bool]) -> asyncio.Future[float]:
        """Look out for the next frame of a kind from now on; the future is when it arrived [s]."""
        future: asyncio.Future[float] = asyncio.get_running_loop().create_future()
        self._awaited = matches, future
        return future

    async def arrival(self, expected: asyncio.Future[float]) -> float:
        """Wait for a frame that `expect` looks out for, and return when it arrived [s].

        Raises
        ------
        SimulationError
            None has come for a minute, the server has closed the stream, or has refused a command.
        """
        await asyncio.wait((expected, self._task), timeout=WAIT_SECONDS, return_when=asyncio.FIRST_COMPLETED)
        if not expected.done():
            self.check()
            raise SimulationError(f"the service sent no such frame as awaited within {WAIT_SECONDS:g} s")
        return expected.result()

    def time_scale(self) -> float:
        """Return the simulated seconds per second between the first and the last frame.

        Raises
        ------
        SimulationError
            There are fewer than two frames, the server has closed the stream, or has refused a command.
        """
        first, last = (struct.unpack_from("<d", one, _TIME_OFFSET)[0] for one in self._ends())
        return float((last - first) / (self.arrivals[-1] - self.arrivals[0]))

    def intervals(self) -> np.ndarray:
        """Return the times between successive frames [ms]; raises as `time_scale`."""
        self._ends()
        return 1e3 * np.diff(self.arrivals)

    def check(self) -> None:
        """Check that the stream is open.

        Raises
        ------
        SimulationError
            The server has closed the stream, or has refused a command.
        """
        if self._task.done():
            self._task.result()
            raise SimulationError(f"the service closed a stream with code {self._stream.close_code}")

    async def end(self) -> None:
        """Stop watching."""
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    def _ends(self) -> tuple[bytes, bytes]:
        self.check()
        if self._first is None or self._last is None or len(self.arrivals) < 2:
            raise SimulationError("a viewer saw fewer than two frames; measure for a longer time")
        return self._first, self._last

    async def _watch(self) -> None:
        try:
            async for message in self._stream:
                if isinstance(message, bytes):
                    self._note(message)
                elif message.startswith(_PROBLEM):
                    raise SimulationError(f"the service answers {message}")
        except ConnectionClosed:
            # `check` tells the code.
            return

    def _note(self, frame: bytes) -> None:
        now = time.perf_counter()
        self.arrivals.append(now)
        self._first = self._first or frame
        self._last = frame
        if self._awaited is not None and self._awaited[0](frame):
            if not self._awaited[1].done():
                self._awaited[1].set_result(now)
            self._awaited = None


def client(address: str) -> httpx.AsyncClient:
    """Return a client of the calls of a server, to be closed."""
    return httpx.AsyncClient(base_url=f"http://{address}", timeout=WAIT_SECONDS, trust_env=False)


async def created(http: httpx.AsyncClient, body: Mapping[str, Any]) -> dict[str, str]:
    """Create a session, and return its links; raises a SimulationError where the server refuses it."""
    links: dict[str, str] = answered(await http.post("/v1/sessions", json=body)).json()["links"]
    return links


def answered(answer: httpx.Response) -> httpx.Response:
    """Return an answer; raises a SimulationError with its text where it is a refusal."""
    if not answer.is_success:
        request = answer.request
        raise SimulationError(f"the service answers {request.method} {request.url.path}: {answer.text}")
    return answer


@asynccontextmanager
async def watching(address: str, links: Mapping[str, str]) -> AsyncIterator[Viewer]:
    """Open a stream of a session, and watch it."""
    uri = f"ws://{address}{links['stream']}?version=2"
    async with connect(uri, compression=None, proxy=None, close_timeout=1.0) as stream:
        viewer = Viewer(stream, links["stream"])
        try:
            yield viewer
        finally:
            await viewer.end()


@asynccontextmanager
async def playing(
    address: str, bodies: Sequence[Mapping[str, Any]], *, viewers: int = 1, speed: float
) -> AsyncIterator[list[Viewer]]:
    """Create sessions that play, and delete them in the end.

    Parameters
    ----------
    address : str
        Host and port of the server.
    bodies : sequence of mapping
        What creates each session.
    viewers : int
        Number of viewers of each session.
    speed : float
        Simulated seconds per second.

    Yields
    ------
    list of Viewer
        The viewers of all sessions, session by session.
    """
    async with client(address) as http, AsyncExitStack() as stack:
        links = [await created(http, body) for body in bodies]
        crowd = [
            await stack.enter_async_context(watching(address, mine)) for mine in links for _ in range(viewers)
        ]
        for viewer in crowd[::viewers]:
            await viewer.send(type="speed", value=speed)
            await viewer.send(type="play")
        yield crowd
        for viewer in crowd:
            viewer.check()
        for mine in links:
            answered(await http.delete(mine["self"]))

"""A real server on a free port, in a thread of the test process, and the means to talk to it."""

import asyncio
import contextlib
import io
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from hybridmpm import BoxSink, RectangularEmitter, Scene
from hybridmpm.control import Arrow, Ellipse
from hybridmpm.stream_frames import Frame, decode
from hybridmpm_service import Settings, create_app
from hybridmpm_service.server import listen, make_server
from hybridmpm_service.sessions.scene_work import SceneSource
from hybridmpm_service.sessions.session import Session

WAIT_SECONDS = 60
"""Far above anything that happens; a test that waits this long has failed."""

SMALL_SCENE: dict[str, Any] = {
    "name": "small",
    "dim": 2,
    "resolution": 32,
    "bodies": [{"shape": "box", "lower": [0.4, 0.4], "upper": [0.6, 0.6], "material": "water"}],
}
SCENE = Scene.parse(SMALL_SCENE)
SOURCE = SceneSource(data=SCENE)
JET = RectangularEmitter(lower=(0.1, 0.6), upper=(0.1, 0.7), material="sand", velocity=(2.0, 0.0))
DRAIN = BoxSink(lower=(0.4, 0.0), upper=(0.6, 0.5))
OPEN_SCENE = SCENE.model_copy(update={"emitters": (JET,), "sinks": (DRAIN,)})
ARROW = Arrow(np.array([[0.5, 0.5], [0.6, 0.55]]))
OVAL = Ellipse(np.array([0.55, 0.6]), np.array([0.15, 0.1]), 0.3)


async def until(happened: Callable[[], object]) -> None:
    """Wait for what has no event."""
    async with asyncio.timeout(WAIT_SECONDS):
        while not happened():  # noqa: ASYNC110
            await asyncio.sleep(0.001)


@pytest.fixture
def anyio_backend() -> str:
    """Return what runs asynchronous tests and fixtures."""
    return "asyncio"


class Stream:
    """One WebSocket of a session."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection

    def send(self, **command: Any) -> None:
        """Send a command."""
        self.connection.send(json.dumps(command))

    def receive(self) -> bytes | dict[str, Any]:
        """Return the next message, a frame or a parsed text."""
        message = self.connection.recv(timeout=WAIT_SECONDS)
        return message if isinstance(message, bytes) else json.loads(message)

    def text(self, kind: str) -> dict[str, Any]:
        """Return the next text message of a type."""
        while True:
            message = self.receive()
            if isinstance(message, dict) and message["type"] == kind:
                return message

    def frame(self) -> bytes:
        """Return the next binary message."""
        while True:
            message = self.receive()
            if isinstance(message, bytes):
                return message

    def reach(self, number: int) -> Frame:
        """Return the first frame from a number on."""
        while (frame := decode(self.frame())).number < number:
            pass
        return frame

    def rewind(self) -> None:
        """Read until frame 0 is there again."""
        while decode(self.frame()).number != 0:
            pass

    def status(self, **fields: Any) -> dict[str, Any]:
        """Return the first status in which fields of the session have some values."""
        while True:
            status = self.text("status")
            if all(status["session"][name] == value for name, value in fields.items()):
                return status

    def end(self) -> int:
        """Read until the server closes the stream, and return the close code."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                self.receive()
        code = self.connection.protocol.close_code
        assert code is not None
        return code


class Service:
    """A running server."""

    def __init__(self, app: FastAPI, server: uvicorn.Server, listener: socket.socket) -> None:
        self.app = app
        self.address = f"127.0.0.1:{listener.getsockname()[1]}"
        self.http = httpx.Client(base_url=f"http://{self.address}", timeout=WAIT_SECONDS)
        self._server = server
        self._thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        self._thread.start()

    def create(self, scene: dict[str, Any] | None = None) -> str:
        """Create a session and return its path."""
        answer = self.http.post("/v1/sessions", json={"scene": scene or SMALL_SCENE})
        assert answer.status_code == 201, answer.text
        path: str = answer.json()["links"]["self"]
        return path

    def session(self, path: str) -> Session:
        """Return the session's object, to put a fault into it."""
        found: Session = self.app.state.sessions.get(path.rpartition("/")[2])
        return found

    def ended(self, job: dict[str, Any]) -> dict[str, Any]:
        """Wait until a job has ended; return its description."""
        deadline = time.monotonic() + WAIT_SECONDS
        while job["phase"] == "running":
            assert time.monotonic() < deadline
            time.sleep(0.01)
            job = self.http.get(job["links"]["self"]).json()
        return job

    @contextlib.contextmanager
    def stream(self, path: str, version: str | None = None, **options: Any) -> Iterator[Stream]:
        """Open a WebSocket, and ask for a version of the frames."""
        query = "" if version is None else f"?version={version}"
        with connect(f"ws://{self.address}{path}/stream{query}", compression=None, **options) as connection:
            yield Stream(connection)

    def stop(self) -> None:
        """Shut down as a signal would."""
        self._server.should_exit = True
        self._thread.join(WAIT_SECONDS)
        assert not self._thread.is_alive()
        self.http.close()


class Hold:
    """A gate in the frames of a session's simulator, which its thread waits at until it is opened."""

    def __init__(self, session: Session) -> None:
        solver = session.simulation._solver
        advance, self.reached, self.gate = solver.advance, threading.Event(), threading.Event()

        def held(frames: int = 1, force: Any = None) -> None:
            self.reached.set()
            assert self.gate.wait(WAIT_SECONDS)
            advance(frames, force)

        solver.advance = held  # type: ignore[method-assign]


def arrays_of(content: bytes) -> dict[str, np.ndarray[Any, Any]]:
    """Return the arrays of an npz file."""
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        return dict(file)


@contextlib.contextmanager
def running(settings: Settings) -> Iterator[Service]:
    """Run a server with these settings; unless they say so, how busy this machine is decides nothing."""
    if settings.max_load is None:
        settings = settings.model_copy(update={"max_load": 64.0})
    app = create_app(settings)
    with listen(settings) as listener:
        service = Service(app, make_server(app), listener)
        try:
            yield service
        finally:
            service.stop()


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    """Return a server with the default settings but few sessions, shared by a module."""
    with running(Settings(port=0, max_sessions=40)) as started:
        yield started


@pytest.fixture
def start() -> Iterator[Callable[..., Service]]:
    """Return a function that starts a server with given settings."""
    with contextlib.ExitStack() as stack:
        yield lambda **settings: stack.enter_context(running(Settings(port=0, **settings)))


@pytest.fixture(scope="module")
def start_module() -> Iterator[Callable[..., Service]]:
    """Return a function that starts a server with given settings, for all tests of a module."""
    with contextlib.ExitStack() as stack:
        yield lambda **settings: stack.enter_context(running(Settings(port=0, **settings)))


@pytest.fixture
def path(service: Service) -> Iterator[str]:
    """Return the path of a fresh session."""
    made = service.create()
    yield made
    service.http.delete(made)


def problem(answer: httpx.Response, status: int) -> dict[str, Any]:
    """Check that an answer is a problem with a status, and return the problem."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    body: dict[str, Any] = answer.json()
    assert body["status"] == status
    assert body["type"].startswith("urn:hybridmpm:problem:")
    assert body["title"]
    assert body["detail"]
    assert body["instance"] == answer.request.url.path
    return body

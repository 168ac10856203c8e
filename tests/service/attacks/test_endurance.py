"""Hostile uploads by the hundred, and clients that come and go: the process does not grow."""

import contextlib
import json
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS
from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.sync.client import connect

from hybridmpm_lab.service.hostile import uploads
from hybridmpm_lab.service.server import Server, running

MIB = 2**20
CLOSE_FLOODED = 1008
RECEIVE_BUFFER = 4096
"""Buffer of a client that does not read [bytes]: what does not fit stays with the server."""


@dataclass(frozen=True)
class Footprint:
    """Resources of a process."""

    memory: int
    """Memory [bytes]."""
    files: int
    """Open files and sockets."""
    threads: int

    @classmethod
    def of(cls, server: Server) -> "Footprint":
        """Measure a server; the test is skipped where the system has no /proc."""
        memory, folder = server.memory(), Path(f"/proc/{server.process.pid}")
        if memory is None:
            pytest.skip("the system lacks /proc")
        return cls(memory, len(list((folder / "fd").iterdir())), len(list((folder / "task").iterdir())))


@pytest.fixture
def server() -> Iterator[Server]:
    with running("--send-seconds", "0.5") as started:
        yield started


@contextlib.contextmanager
def _http(server: Server) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=server.address, timeout=WAIT_SECONDS) as client:
        yield client


def _create(client: httpx.Client) -> dict[str, str]:
    answer = client.post("/v1/sessions", json={"scene": SMALL_SCENE})
    assert answer.status_code == 201, answer.text
    links: dict[str, str] = answer.json()["links"]
    return links


def _mangled(content: bytes, source: random.Random) -> bytes:
    """Return the content cut off, with a part moved, or with wrong bytes; it is no honest request, either."""
    place = source.randrange(1, len(content))
    match source.randrange(3):
        case 0:
            return content[:place]
        case 1:
            return content[place:] + content[:place]
        case _:
            return content[:place] + source.randbytes(source.randrange(1, 64)) + content[place + 1 :]


@pytest.mark.parametrize(
    "count", [20, pytest.param(1000, marks=[pytest.mark.long, pytest.mark.timeout(1800)])]
)
def test_hostile_uploads_are_refused_and_leave_nothing(server: Server, count: int) -> None:
    source, known = random.Random(count), uploads()
    with _http(server) as client:
        links = _create(client) | {"sessions": "/v1/sessions"}

        def send(index: int) -> None:
            one = known[index % len(known)]
            content = one.content if index < len(known) else _mangled(one.content, source)
            kind = (
                {"files": {"sketch": ("sketch.png", content, "image/png")}}
                if one.is_picture
                else {"content": content}
            )
            headers = {} if one.is_picture else {"Content-Type": "application/json"}
            answer = client.post(links[one.target], headers=headers, **kind)
            assert 400 <= answer.status_code < 500, (index, answer.text)
            assert len(answer.content) < 64 * 1024

        for index in range(count // 2):
            send(index)
        before = Footprint.of(server)
        for index in range(count // 2, count):
            send(index)
        after = Footprint.of(server)
        assert client.get(links["self"]).status_code == 200
        assert client.get("/readyz").status_code == 200
    # Pictures and bodies of megabytes come and go; a leak of one in ten would be seen.
    assert after.memory < before.memory + 40 * MIB
    assert after.files <= before.files + 2
    assert after.threads <= before.threads + 2


class Crowd:
    """Clients of a server that come and go, each in a thread of its own, until a time is over."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._stop = threading.Event()
        self.visits: dict[str, int] = {}
        self.faults: list[BaseException] = []

    def stay(self, seconds: float, kinds: list[Callable[["Crowd"], None]]) -> None:
        """Let clients of all kinds visit the server for so long [s]."""
        threads = [threading.Thread(target=self._come_and_go, args=(kind,)) for kind in kinds]
        for thread in threads:
            thread.start()
        time.sleep(seconds)
        self._stop.set()
        for thread in threads:
            thread.join(WAIT_SECONDS)
            assert not thread.is_alive()
        self._stop.clear()
        if self.faults:
            raise self.faults[0]

    def _come_and_go(self, kind: Callable[["Crowd"], None]) -> None:
        try:
            while not self._stop.is_set():
                kind(self)
                self.visits[kind.__name__] = self.visits.get(kind.__name__, 0) + 1
        except BaseException as fault:  # noqa: BLE001 - the test fails with it
            self.faults.append(fault)

    def pause(self, seconds: float) -> None:
        """Wait, but not beyond the end."""
        self._stop.wait(seconds)

    def http(self) -> contextlib.AbstractContextManager[httpx.Client]:
        """Connect to the server."""
        return _http(self._server)

    @contextlib.contextmanager
    def stream(self, links: dict[str, str], **options: Any) -> Iterator[Any]:
        """Watch a session."""
        with connect(
            f"ws{self._server.address.removeprefix('http')}{links['stream']}",
            compression=None,
            close_timeout=1,
            **options,
        ) as stream:
            yield stream

    def raw(self) -> socket.socket:
        """Return a connection whose own buffer is small."""
        client_socket = socket.socket()
        client_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        client_socket.connect(("127.0.0.1", self._server.port))
        return client_socket


def honest(crowd: Crowd) -> None:
    """Make a session, watch it play, and delete it."""
    with crowd.http() as client:
        links = _create(client)
        with crowd.stream(links) as stream:
            stream.send(json.dumps({"type": "play"}))
            for _ in range(10):
                stream.recv(timeout=WAIT_SECONDS)
        assert client.delete(links["self"]).status_code == 204


def careless(crowd: Crowd) -> None:
    """Make a session, let it play, and leave it."""
    with crowd.http() as client:
        links = _create(client)
        with crowd.stream(links) as stream:
            stream.send(json.dumps({"type": "play"}))
            crowd.pause(0.2)
        # It expires after three seconds; more of them would meet the limit.
        crowd.pause(2.0)


def silent(crowd: Crowd) -> None:
    """Connect, and send half a request."""
    with crowd.raw() as client_socket:
        client_socket.sendall(b"POST /v1/sessions HTTP/1.1\r\nHost: 127.0")
        crowd.pause(0.3)


def sleeping(crowd: Crowd) -> None:
    """Watch a session, and read nothing."""
    with crowd.http() as client, crowd.raw() as client_socket:
        links = _create(client)
        with (
            contextlib.suppress(ConnectionClosed, OSError),
            crowd.stream(links, sock=client_socket, max_queue=1) as one,
        ):
            one.send(json.dumps({"type": "play"}))
            crowd.pause(1.0)
        client.delete(links["self"])


def flooding(crowd: Crowd) -> None:
    """Send messages until the server closes the stream."""
    with crowd.http() as client:
        links = _create(client)
        with crowd.stream(links) as stream:
            with contextlib.suppress(ConnectionClosed):
                for _ in range(5000):
                    stream.send('{"type": "push_end"}')
                while True:
                    stream.recv(timeout=WAIT_SECONDS)
            # A client that sends on after the end may meet a reset connection before it reads the reason.
            assert stream.protocol.close_code in (CLOSE_FLOODED, CloseCode.ABNORMAL_CLOSURE)
        client.delete(links["self"])


KINDS = [honest, careless, silent, sleeping, flooding]


@pytest.mark.parametrize(
    "seconds", [1.0, pytest.param(300.0, marks=[pytest.mark.long, pytest.mark.timeout(1800)])]
)
def test_clients_that_come_and_go_leave_nothing(seconds: float) -> None:
    with running("--idle-seconds", "3", "--send-seconds", "0.5") as server:
        _come_and_go(server, seconds)


def _come_and_go(server: Server, seconds: float) -> None:
    crowd = Crowd(server)
    crowd.stay(seconds, KINDS)
    before = Footprint.of(server)
    crowd.stay(seconds, KINDS)
    assert set(crowd.visits) == {kind.__name__ for kind in KINDS}
    # Sessions that were left expire, with their threads and connections.
    with _http(server) as client:
        deadline = time.monotonic() + WAIT_SECONDS
        while client.get("/v1/sessions").json()["sessions"]:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        after = Footprint.of(server)
    assert after.memory < before.memory + 40 * MIB
    assert after.files <= before.files + 4
    assert after.threads <= before.threads + 4

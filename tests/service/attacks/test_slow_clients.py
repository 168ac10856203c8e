"""Clients that read, send or stay as they like: they cost themselves, and nobody else."""

import contextlib
import json
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS, Hold
from websockets.sync.client import connect

from hybridmpm.stream_frames import decode
from hybridmpm_service.http.connection import Throttle

DENSE_SCENE: dict[str, Any] = {
    "dim": 2,
    "resolution": 64,
    "particles_per_cell": 64,
    "bodies": [{"shape": "box", "lower": [0.2, 0.2], "upper": [0.6, 0.6], "material": "water"}],
}
"""A frame of it has 160 KB, so that few of them fill all buffers on the way to a client."""
SLOW_SCENE: dict[str, Any] = {
    "dim": 2,
    "resolution": 190,
    "frame_dt": 0.015,
    "bodies": [
        {
            "shape": "box",
            "lower": [0.3, 0.3],
            "upper": [0.6, 0.6],
            "material": {"kind": "elastic", "density": 1000, "youngs_modulus": 2.5e9, "poisson_ratio": 0.2},
        }
    ],
}
"""A frame of it takes many seconds."""
costly = pytest.mark.filterwarnings("ignore::hybridmpm.CostlyMaterialWarning")


def _until(happened: Callable[[], object]) -> None:
    """Wait until something has happened."""
    deadline = time.monotonic() + WAIT_SECONDS
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def _address(service: Any) -> tuple[str, int]:
    host, _, port = service.address.partition(":")
    return host, int(port)


@contextlib.contextmanager
def _raw(service: Any, head: bytes = b"") -> Iterator[socket.socket]:
    """Connect, and send the beginning of a request."""
    with socket.create_connection(_address(service), timeout=WAIT_SECONDS) as connection:
        connection.sendall(head)
        yield connection


def _all_of(connection: socket.socket) -> bytes:
    """Read until the server closes the connection."""
    received = b""
    while part := connection.recv(65536):
        received += part
    return received


def _post(path: str, body: bytes, declared: int | None = None) -> bytes:
    size = len(body) if declared is None else declared
    lines = (
        f"POST {path} HTTP/1.1",
        "Host: 127.0.0.1",
        "Content-Type: application/json",
        f"Content-Length: {size}",
    )
    return "\r\n".join((*lines, "", "")).encode() + body


def test_a_viewer_that_stops_reading_is_dropped_and_its_session_pauses(start: Callable[..., Any]) -> None:
    service = start(send_seconds=0.2)
    path = service.create(DENSE_SCENE)
    session = service.session(path)
    with socket.socket() as client_socket:
        client_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client_socket.connect(_address(service))
        address = f"ws://{service.address}{path}/stream"
        with connect(address, sock=client_socket, compression=None, max_queue=1, close_timeout=0) as sleeping:
            sleeping.send(json.dumps({"type": "play"}))
            _until(lambda: session.view.frame)
            _until(lambda: not session.watched)
            _until(lambda: not session.playing)
            # Nothing of it is kept: the connection has been ended, whatever was on its way.
            _until(
                lambda: not [c for c in service._server.server_state.connections if hasattr(c, "writable")]
            )
    with service.stream(path) as stream:
        stream.send(type="step")
        stream.frame()


def test_connections_have_bounded_buffers_and_end_if_nothing_is_acknowledged(
    start: Callable[..., Any],
) -> None:
    service = start()
    with service.stream(service.create()) as stream:
        stream.receive()
        for connection in service._server.server_state.connections:
            client_socket = connection.transport.get_extra_info("socket")
            # The system reports twice the size that it was asked for.
            assert client_socket.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF) <= 2 * 512 * 1024
            if hasattr(socket, "TCP_USER_TIMEOUT"):
                assert client_socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 20_000


@pytest.mark.parametrize(
    "start_of",
    [
        b"GET /livez HTTP/1.1\r\nHost: 127.0",
        _post("/v1/sessions", b'{"sce', declared=100),
    ],
    ids=["head", "body"],
)
def test_a_request_that_is_not_sent_to_its_end_is_refused(
    start_module: Callable[..., Any], start_of: bytes
) -> None:
    service = _impatient(start_module)
    with _raw(service, start_of) as connection:
        answer = _all_of(connection)
    assert b"HTTP/1.1 408 Request Timeout\r\n" in answer
    body = json.loads(answer.rpartition(b"\r\n\r\n")[2])
    assert (body["status"], body["type"]) == (408, "urn:hybridmpm:problem:request-timeout")


def test_a_second_request_has_the_same_deadline(start_module: Callable[..., Any]) -> None:
    with _raw(_impatient(start_module), b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n") as connection:
        assert connection.recv(65536).startswith(b"HTTP/1.1 200 ")
        connection.sendall(b"GET /li")
        assert b"HTTP/1.1 408 " in _all_of(connection)


def test_single_bytes_do_not_extend_the_deadline(start_module: Callable[..., Any]) -> None:
    service = _impatient(start_module)
    with _raw(service, b"GET /livez HTTP/1.1\r\n") as connection:
        connection.settimeout(0.02)
        answer = b""
        for _ in range(1000):
            with contextlib.suppress(TimeoutError, ConnectionError):
                connection.sendall(b"X: x\r\n")
                answer = connection.recv(65536)
            if answer:
                break
        assert answer.startswith(b"HTTP/1.1 408 ")


def test_a_stream_outlives_the_deadline_of_requests(start_module: Callable[..., Any]) -> None:
    service = _impatient(start_module)
    # Sent at once: two writes of a client on a busy machine may be further apart than the deadline.
    body = json.dumps({"scene": SMALL_SCENE}).encode()
    with _raw(service, _post("/v1/sessions", body)) as connection:
        while b"\r\n\r\n" not in (answer := connection.recv(65536, socket.MSG_PEEK)):
            pass
    path = re.search(rb"location: (\S+)", answer, re.IGNORECASE)
    assert path is not None, answer
    with service.stream(path[1].decode()) as stream:
        time.sleep(0.4)
        stream.send(type="step")
        stream.frame()


def test_a_connection_without_a_request_ends_without_an_answer(start_module: Callable[..., Any]) -> None:
    with _raw(_impatient(start_module)) as connection:
        assert _all_of(connection) == b""


def test_bytes_that_are_not_http_are_refused_with_a_problem(start_module: Callable[..., Any]) -> None:
    with _raw(_impatient(start_module), b"\x16\x03\x01\r\n\r\n") as connection:
        answer = _all_of(connection)
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert json.loads(answer.rpartition(b"\r\n\r\n")[2])["status"] == 400


_started: list[Any] = []


def _impatient(start_module: Callable[..., Any]) -> Any:
    """Return a server that waits a quarter of a second for requests, the same one for all tests."""
    if not _started:
        _started.append(start_module(request_seconds=0.25))
    return _started[0]


class _Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_throttle_admits_a_rate_with_bursts() -> None:
    clock = _Clock()
    throttle = Throttle(rate=10, burst=4, clock=clock)
    assert [throttle.admits(1) for _ in range(5)] == [True] * 4 + [False]
    clock.now = 0.25
    assert [throttle.admits(1) for _ in range(3)] == [True, True, False]
    clock.now = 60
    assert throttle.admits(4)
    assert not throttle.admits(0.25)


def test_a_flood_of_messages_ends_its_own_stream_alone(start: Callable[..., Any]) -> None:
    service = start(max_messages_per_second=0.001, max_messages_at_once=20)
    path = service.create()
    with service.stream(path) as other, service.stream(path) as stream:
        with contextlib.suppress(ConnectionError):
            for _ in range(21):
                stream.send(type="speed", value=0.5)
        assert stream.end() == 1008
        assert "messages a second, 20 at once" in stream.connection.protocol.close_reason
        other.send(type="step")
        while decode(other.frame()).number < 1:
            pass


_MASK = bytes(4)
_PING = b"\x89" + bytes([0x80 | 125]) + _MASK + bytes(125)
_FLOODS = {
    "pings": 1000 * _PING,
    "empty pongs": 1000 * (b"\x8a\x80" + _MASK),
    "empty parts": b"\x01\x80" + _MASK + 1000 * (b"\x00\x80" + _MASK),
    "large messages": 20 * (b"\x82\xfe\xff\x00" + _MASK + bytes(0xFF00)),
}
"""Bytes of a stream: few messages, or none."""


def _upgraded(service: Any, path: str, **options: Any) -> socket.socket:
    upgrade = (
        f"GET {path}/stream HTTP/1.1",
        "Host: 127.0.0.1",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
    )
    client_socket = socket.socket()
    client_socket.settimeout(WAIT_SECONDS)
    client_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client_socket.connect(_address(service))
    client_socket.sendall("\r\n".join((*upgrade, "", "")).encode())
    _until(lambda: service.session(path).watched)
    return client_socket


@pytest.mark.parametrize("kind", [*_FLOODS, "single bytes"])
def test_whatever_a_stream_sends_is_metered(start_module: Callable[..., Any], kind: str) -> None:
    """The client reads nothing, and would fill memory if it were answered."""
    service = _metered(start_module)
    path = service.create()
    with _upgraded(service, path) as client_socket:
        with contextlib.suppress(ConnectionError):
            if kind in _FLOODS:
                client_socket.sendall(_FLOODS[kind])
            else:
                client_socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for _ in range(1000):
                    client_socket.sendall(b"\x8a\xfd")
                    time.sleep(0.001)
        _until(lambda: not service.session(path).watched)
    assert service.http.get("/livez").status_code == 200
    service.http.delete(path)


_metered_servers: list[Any] = []


def _metered(start_module: Callable[..., Any]) -> Any:
    """Return a server whose streams may send little, the same one for all tests."""
    if not _metered_servers:
        _metered_servers.append(start_module(max_messages_per_second=0.001, max_messages_at_once=40))
    return _metered_servers[0]


def test_a_body_of_tiny_chunks_is_refused(start_module: Callable[..., Any]) -> None:
    head = b"POST /v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n"
    with _raw(_metered(start_module), head) as connection:
        with contextlib.suppress(ConnectionError):
            connection.sendall(5000 * b"1\r\n \r\n")
        answer = _all_of(connection)
    assert answer.startswith(b"HTTP/1.1 400 ")


def test_a_body_of_usual_chunks_is_read(start_module: Callable[..., Any]) -> None:
    head = b"POST /v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    head += b"Connection: close\r\nTransfer-Encoding: chunked\r\n\r\n"
    text = json.dumps({"scenario": "x" * 60_000}).encode()
    parts = [text[start : start + 512] for start in range(0, len(text), 512)]
    with _raw(_metered(start_module), head) as connection:
        for part in parts:
            connection.sendall(b"%x\r\n%b\r\n" % (len(part), part))
        connection.sendall(b"0\r\n\r\n")
        assert _all_of(connection).startswith(b"HTTP/1.1 422 ")


def test_whoever_does_not_read_a_large_answer_is_dropped(start: Callable[..., Any]) -> None:
    service = start(send_seconds=0.2)
    path = service.create(DENSE_SCENE)
    with socket.socket() as client_socket:
        client_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client_socket.connect(_address(service))
        client_socket.sendall(f"GET {path}/particles HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        connections = service._server.server_state.connections
        _until(lambda: any(getattr(one, "_unread", None) for one in list(connections)))
        _until(lambda: not any(getattr(one, "_unread", None) for one in list(connections)))
    assert service.http.get(path).status_code == 200


def test_calls_whose_clients_have_gone_are_cancelled(start: Callable[..., Any]) -> None:
    service = start()
    path = service.create()
    session = service.session(path)
    hold = Hold(session)
    with contextlib.ExitStack() as connections:
        for _ in range(10):
            connections.enter_context(_raw(service, _post(f"{path}/advance", b'{"frames": 2000}')))
        assert hold.reached.wait(WAIT_SECONDS)
        _until(lambda: session._calls == 10)
    _until(lambda: session._calls == 0)
    hold.gate.set()
    # One was at its first frame; the others had not started.
    assert service.http.post(f"{path}/advance", json={"frames": 1}).json()["frame"] == 2


def test_a_delete_is_done_though_its_client_has_gone(start_module: Callable[..., Any]) -> None:
    """A page that is closed deletes its session and waits for no answer."""
    service = start_module()
    paths = [service.create() for _ in range(8)]
    for path in paths:
        with _raw(service, f"DELETE {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()):
            pass
    _until(lambda: service.http.get("/v1/sessions").json()["sessions"] == [])


@costly
def test_a_stop_answers_the_calls_that_wait_with_503(
    start: Callable[..., Any], problem: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridmpm_service.server._GRACE_SECONDS", WAIT_SECONDS)
    service = start(max_frame_cost=10**9)
    path = service.create(SLOW_SCENE)
    answers: list[httpx.Response] = []

    def call() -> None:
        with httpx.Client(base_url=f"http://{service.address}", timeout=WAIT_SECONDS) as client:
            answers.append(client.post(f"{path}/advance", json={"frames": 3}))

    callers = [threading.Thread(target=call) for _ in range(3)]
    for caller in callers:
        caller.start()
    with _raw(service, _post("/v1/sessions", b"{", declared=1000)) as uploading:
        _until(lambda: service.session(path)._calls == 3)
        service._server.should_exit = True
        assert _all_of(uploading).startswith(b"HTTP/1.1 503 ")
    for caller in callers:
        caller.join(WAIT_SECONDS)
    assert len(answers) == 3
    for answer in answers:
        assert "shutting down" in problem(answer, 503)["detail"]
        assert answer.headers["retry-after"]
    service._thread.join(WAIT_SECONDS)
    assert not service._thread.is_alive()
    assert service.app.state.sessions._ending == set()


@costly
def test_a_delete_over_http_ends_the_frame_and_answers_the_caller(start: Callable[..., Any]) -> None:
    service = start(max_frame_cost=10**9)
    path = service.create(SLOW_SCENE)
    session = service.session(path)
    answers: list[httpx.Response] = []

    def call() -> None:
        answers.append(httpx.post(f"http://{service.address}{path}/advance", json={}, timeout=WAIT_SECONDS))

    caller = threading.Thread(target=call)
    caller.start()
    _until(lambda: session._worker._unfinished)
    assert service.http.delete(path).status_code == 204
    caller.join(WAIT_SECONDS)
    assert answers[0].status_code == 404
    assert [thread.name for thread in threading.enumerate() if session.id[:8] in thread.name] == []


@costly
def test_a_scene_whose_frames_cost_too_much_is_refused_over_http(
    start: Callable[..., Any], problem: Any
) -> None:
    body = problem(start().http.post("/v1/sessions", json={"scene": SLOW_SCENE}), 422)
    assert "= 246" in body["detail"]
    assert "up to 20000000 (setting max_frame_cost)" in body["detail"]

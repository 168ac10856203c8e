"""Starting and stopping, as an operator sees it."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from hybridmpm_service import ServeError, Settings, serve, server
from hybridmpm_service.server import with_files

WAIT_SECONDS = 60


@pytest.fixture
def occupied() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


def _run(*flags: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hybridmpm_service", *flags],
        capture_output=True,
        text=True,
        timeout=WAIT_SECONDS,
        check=False,
        env=os.environ | environment,
    )


def test_a_port_in_use_is_one_line_that_says_what_to_do(occupied: int) -> None:
    with pytest.raises(ServeError, match=f"127.0.0.1 port {occupied}.*in use.*--port"):
        serve(port=occupied)
    done = _run("--port", str(occupied))
    assert done.returncode == 1
    assert done.stderr.startswith("Error: ")
    assert done.stderr.count("\n") == 1


def test_a_bad_setting_is_one_line_and_status_2() -> None:
    done = _run(HYBRIDMPM_MAX_SESSIONS="none")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "HYBRIDMPM_MAX_SESSIONS" in done.stderr


@pytest.mark.parametrize(("host", "warns"), [("127.0.0.1", False), ("0.0.0.0", True)])  # noqa: S104
def test_an_address_that_others_can_reach_is_warned_of(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, host: str, warns: bool
) -> None:
    monkeypatch.setattr(server, "make_server", lambda _app: SimpleNamespace(run=lambda **_sockets: None))
    serve(host=host, port=0)
    told = capsys.readouterr()
    assert ("0.0.0.0 can be reached from other machines" in told.err) is warns
    assert "listens on" in told.out


def test_help_names_every_setting() -> None:
    done = _run("--help")
    assert done.returncode == 0
    for flag in ("--host", "--port", "--max-sessions", "--idle-seconds", "--cors-origins"):
        assert flag in done.stdout


@pytest.mark.parametrize(("sent", "status"), [(signal.SIGTERM, -signal.SIGTERM), (signal.SIGINT, 130)])
def test_a_signal_ends_the_process_in_order(sent: signal.Signals, status: int) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "hybridmpm_service", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            address = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
            assert address is not None
            with httpx.Client(base_url=address.group(), timeout=WAIT_SECONDS) as client:
                assert client.post("/v1/sessions", json={"scenario": "water_2d"}).status_code == 201
            process.send_signal(sent)
            _, errors = process.communicate(timeout=WAIT_SECONDS)
        finally:
            process.kill()
    assert process.returncode == status
    assert errors == ""


def test_a_stopping_server_says_goodbye_with_1001(start: Callable[..., Any]) -> None:
    service = start()
    path = service.create()
    with service.stream(path) as stream, service.stream(path) as other:
        stream.send(type="play")
        stream.frame()
        service._server.should_exit = True
        assert stream.end() == 1001
        assert other.end() == 1001


def test_no_answer_waits_for_an_acknowledgement(start: Callable[..., Any]) -> None:
    service = start()
    path = service.create()
    with service.stream(path) as stream:
        stream.receive()
        connections = list(service._server.server_state.connections)
        assert len(connections) == 2
        for connection in connections:
            upsampler = connection.transport.get_extra_info("socket")
            assert upsampler.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_importing_the_package_starts_nothing_and_reads_no_environment() -> None:
    code = "import hybridmpm_service, threading; print(threading.active_count())"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"HYBRIDMPM_PORT": "nonsense"},
    )
    assert done.stdout.strip() == "1"


@pytest.mark.parametrize(
    ("soft", "hard", "connections"), [(256, 4096, 1000), (1024, 1024, 700), (4096, 4096, 1000)]
)
def test_connections_fit_the_files_of_the_process(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    soft: int,
    hard: int,
    connections: int,
) -> None:
    resource = pytest.importorskip("resource")
    limits = [soft, hard]
    monkeypatch.setattr(resource, "getrlimit", lambda _: tuple(limits))
    monkeypatch.setattr(resource, "setrlimit", lambda _, new: limits.__setitem__(slice(None), new))
    found = with_files(Settings(state_folder="sessions")).max_connections
    assert found <= connections
    assert found > connections - 100
    assert limits[0] >= found + 64
    warned = capsys.readouterr().err
    assert ("ulimit -n" in warned) == (found < 1000)
    limits[:] = [256, 256]
    with pytest.raises(ServeError, match=r"this process may open 256: raise the limit \(ulimit -n"):
        with_files(Settings(max_connections=500))
    limits[:] = [64, 64]
    with pytest.raises(ServeError, match="may open 64"):
        with_files(Settings())

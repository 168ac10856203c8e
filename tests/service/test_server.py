"""Settings, starting and stopping, as an operator sees them."""

import importlib.util
import os
import re
import signal
import socket
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from hybridmpm import ConfigError
from hybridmpm_service import ServeError, Settings, serve, server
from hybridmpm_service.keys.file import add
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


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])  # noqa: S104
@pytest.mark.parametrize("way", ["", "open", "keys"])
def test_others_are_served_with_keys_or_where_a_flag_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, host: str, way: str
) -> None:
    monkeypatch.setattr(server, "make_server", lambda _app: SimpleNamespace(run=lambda **_sockets: None))
    add(tmp_path / "keys", "anna", "view")
    flags: dict[str, Any] = {"": {}, "open": {"open": "true"}, "keys": {"keys": str(tmp_path / "keys")}}[way]
    if host == "0.0.0.0" and not way:  # noqa: S104
        with pytest.raises(ConfigError, match=r"no keys: make one with `hybridmpm key NAME .*or add --open"):
            serve(host=host, port=0)
        assert capsys.readouterr().out == ""
        return
    serve(host=host, port=0, **flags)
    told = capsys.readouterr()
    assert ("no call needs a key" in told.err) is (host == "0.0.0.0" and way == "open")  # noqa: S104
    assert "listens on" in told.out


def test_open_stands_alone_on_the_command_line_and_excludes_keys(tmp_path: Path) -> None:
    done = _run("--open", "--keys", str(tmp_path / "keys"), "--port", "0")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--open and --keys exclude each other" in done.stderr
    done = _run("--keys", str(tmp_path / "keys"), "--port", "0")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "hybridmpm key NAME --file" in done.stderr


def test_a_signal_makes_a_service_with_keys_read_them_again(tmp_path: Path) -> None:
    file = tmp_path / "keys"
    add(file, "anna", "view")
    command = [sys.executable, "-m", "hybridmpm_service", "--port", "0", "--keys", str(file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            address = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
            with httpx.Client(base_url=address.group(), timeout=WAIT_SECONDS) as client:
                client.get("/livez")
                token = add(file, "bob", "view")
                client.headers["Authorization"] = f"Bearer {token}"
                assert client.get("/v1/models").status_code == 401
                process.send_signal(signal.SIGHUP)
                while "were read again: there are 2" not in process.stderr.readline():
                    pass
                assert client.get("/v1/models").status_code == 200
        finally:
            process.kill()


@pytest.mark.parametrize(("sent", "status"), [(signal.SIGTERM, -signal.SIGTERM), (signal.SIGINT, 130)])
def test_a_signal_ends_the_process_in_order(sent: signal.Signals, status: int) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "hybridmpm_service", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            address = re.search(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
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
    ("soft", "hard", "connections"), [(256, 4096, 1000), (1024, 1024, 800), (4096, 4096, 1000)]
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


def test_flags_win_over_the_environment_and_this_over_defaults() -> None:
    environment = {"HYBRIDMPM_PORT": "9000", "HYBRIDMPM_MAX_SESSIONS": "3", "PORT": "1"}
    settings = Settings.load(environment, port=9001, host=None)
    assert (settings.port, settings.max_sessions, settings.host) == (9001, 3, "127.0.0.1")


def test_lists_are_separated_by_commas() -> None:
    settings = Settings.load({"HYBRIDMPM_CORS_ORIGINS": "https://a.example, https://b.example"})
    assert settings.cors_origins == ("https://a.example", "https://b.example")


@pytest.mark.parametrize(
    ("environment", "flags", "message"),
    [
        ({"HYBRIDMPM_PORT": "70000"}, {}, "HYBRIDMPM_PORT.*less than or equal to 65535.*70000"),
        ({"HYBRIDMPM_MAX_SESSIONS": "many"}, {}, "HYBRIDMPM_MAX_SESSIONS"),
        ({}, {"port": -1}, "--port.*greater than or equal to 0"),
        ({}, {"idle_seconds": float("nan")}, "--idle-seconds"),
        ({}, {"colour": "red"}, "--colour"),
    ],
)
def test_bad_settings_are_refused_by_name_and_range(
    environment: dict[str, str], flags: dict[str, object], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        Settings.load(environment, **flags)


@pytest.mark.parametrize(
    ("host", "loopback"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("example.org", False)],  # noqa: S104
)
def test_only_loopback_restricts_host_names_by_itself(*, host: str, loopback: bool) -> None:
    assert Settings(host=host).is_loopback is loopback
    assert (Settings(host=host).hosts is not None) is loopback
    assert Settings(host=host, allowed_hosts=("a.example",)).hosts == ("a.example",)


def test_the_document_tells_every_setting_with_its_default() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reference" / "http-api.md").read_text(encoding="utf-8")
    section = text.partition("## Settings")[2]
    rows = [line for line in section.splitlines() if line.startswith("|")]
    for name, field in Settings.model_fields.items():
        (row,) = [line for line in rows if f"`{name}`" in line]
        if isinstance(field.default, int) and not name.endswith("_bytes"):
            assert str(field.default) in row


SERVICE = Path(__file__).parents[2] / "service"


@pytest.mark.skipif(
    importlib.util.find_spec("hatchling") is None, reason="needs the build backend: pip install hatchling"
)
def test_the_wheel_carries_the_page_and_every_module(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)],
        cwd=SERVICE,
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    package = SERVICE / "hybridmpm_service"
    expected = {
        str(file.relative_to(SERVICE))
        for file in package.rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert names == expected
    assert "hybridmpm_service/page/index.html" in names

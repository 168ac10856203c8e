"""The files for operators: calls through the proxy, and what their readers say of the others."""

import configparser
import contextlib
import os
import re
import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest
import yaml
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS, Service, Stream
from websockets.sync.client import connect

from hybridmpm.client import Client

DEPLOY = Path(__file__).parents[2] / "service" / "deploy"
GUIDE = Path(__file__).parents[2] / "docs" / "guide" / "operating.md"


@pytest.fixture
def start_proxy(start: Callable[..., Service]) -> Iterator[Callable[..., tuple[Service, str]]]:
    """Return a function that starts a service, and HAProxy before it, whose address it returns as well."""
    haproxy = shutil.which("haproxy", path=f"{os.environ['PATH']}:/usr/sbin")
    if haproxy is None:
        assert "CI" not in os.environ, "HAProxy is missing: apt-get install haproxy"
        pytest.skip("needs HAProxy: apt-get install haproxy")

    with ExitStack() as stack:

        def start_both(
            configuration: Path = DEPLOY / "haproxy.cfg", certificate: Path | None = None
        ) -> tuple[Service, str]:
            service = start(allowed_hosts=("proxy.example", "localhost", "127.0.0.1"))
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", 0))
                address = f"127.0.0.1:{probe.getsockname()[1]}"
            listen = address if certificate is None else f"{address} ssl crt {certificate}"
            environment = os.environ | {"NODE": service.address, "LISTEN": listen}
            command = [haproxy, "-db", "-f", DEPLOY / "common.cfg", "-f", configuration]
            process = stack.enter_context(subprocess.Popen(command, env=environment))
            stack.callback(process.kill)
            deadline = time.monotonic() + WAIT_SECONDS
            while True:
                assert time.monotonic() < deadline
                assert process.poll() is None
                with contextlib.suppress(OSError):
                    socket.create_connection(("127.0.0.1", int(address.partition(":")[2]))).close()
                    return service, address
                time.sleep(0.05)

        yield start_both


def test_calls_and_streams_pass_the_proxy_and_metrics_do_not(
    start_proxy: Callable[..., tuple[Service, str]],
) -> None:
    service, address = start_proxy()
    path = service.create()
    headers = {"Host": "proxy.example", "X-Forwarded-For": "203.0.113.9"}
    with httpx.Client(base_url=f"http://{address}", headers=headers, timeout=WAIT_SECONDS) as client:
        assert client.get("/").status_code == 200
        for one in ("/metrics", "/%6detrics", "/metrics?a", "/%6Detrics"):
            assert client.get(one).status_code == 404
        assert client.post(f"{path}/advance", json={"frames": 2}).json()["frame"] == 2
        origin = {"Origin": "http://proxy.example", "Host": "proxy.example"}
        assert client.post(f"{path}/advance", json={}, headers=origin).status_code == 200
    text = service.http.get("/metrics").text
    assert 'route="/v1/sessions/{session_id}/advance",status="200"} 2.0' in text
    with connect(f"ws://{address}{path}/stream", additional_headers={"X-Request-ID": "w"}) as socket_:
        stream = Stream(socket_)
        stream.send(type="play")
        assert stream.reach(5).number >= 5


PREFIX = """    http-request redirect location /fluids/ if { path /fluids }
    http-request replace-path /fluids/(.*) /\\1
"""
"""What the guide adds to the frontend for a service below a prefix."""


def test_a_service_below_a_prefix(start_proxy: Callable[..., tuple[Service, str]], tmp_path: Path) -> None:
    assert PREFIX in GUIDE.read_text("utf-8")
    text = (DEPLOY / "haproxy.cfg").read_text("utf-8")
    (tmp_path / "prefix.cfg").write_text(
        text.replace("    default_backend", f"{PREFIX}    default_backend"), "utf-8"
    )
    address = start_proxy(tmp_path / "prefix.cfg")[1]
    with Client(f"http://{address}/fluids") as client:
        session = client.create(scene=SMALL_SCENE)
        assert session.advance(2)["frame"] == 2
        with session.stream() as stream:
            assert stream.hello["session"]["frame"] == 2
        session.delete()
    moved = httpx.get(f"http://{address}/fluids")
    assert (moved.status_code, moved.headers["location"]) == (302, "/fluids/")
    page = httpx.get(f"http://{address}/fluids/")
    assert "hybridmpm" in page.text
    absolute = re.findall(r'(?:src|href)="(/[^"]*)"', page.text)
    assert absolute == [], "the page finds its files wherever it is"


@pytest.mark.long
def test_calls_and_streams_pass_the_proxy_by_tls(
    start_proxy: Callable[..., tuple[Service, str]], tmp_path: Path
) -> None:
    key, certificate, both = (tmp_path / name for name in ("key.pem", "cert.pem", "both.pem"))
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl")
    names = "subjectAltName=DNS:localhost,IP:127.0.0.1"
    command = [
        "openssl",
        "req",
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-days",
        "2",
        "-subj",
        "/CN=localhost",
    ]
    command += ["-addext", names, "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(command, check=True, capture_output=True)
    both.write_bytes(certificate.read_bytes() + key.read_bytes())
    service, address = start_proxy(certificate=both)
    trusted = ssl.create_default_context(cafile=certificate)
    path = service.create()
    origin = {"Origin": f"https://{address}"}
    with httpx.Client(base_url=f"https://{address}", verify=trusted, timeout=WAIT_SECONDS) as client:
        assert client.post(f"{path}/advance", json={"frames": 2}, headers=origin).json()["frame"] == 2
        # The address of the preview picture shows that the service knows of TLS.
        assert f"https://{address}/share/preview.png" in client.get("/").text
    with connect(f"wss://{address}{path}/stream", ssl=trusted) as socket_:
        stream = Stream(socket_)
        stream.send(type="play")
        assert stream.reach(5).number >= 5
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"https://{address}/livez")
    claimed = {"X-Forwarded-Proto": "https", "Host": service.address}
    assert "https://" in service.http.get("/", headers=claimed).text, "believed of programs on this machine"


def test_the_other_files_are_read() -> None:
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text("utf-8"))
    assert compose["services"]["hybridmpm"]["read_only"] is True
    assert set(compose["volumes"]) == {"state"}
    proxy = compose["services"]["proxy"]["networks"]["inner"]["ipv4_address"]
    assert compose["services"]["hybridmpm"]["environment"]["HYBRIDMPM_PROXIES"] == proxy
    unit = configparser.RawConfigParser(strict=True)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read(DEPLOY / "hybridmpm.service", encoding="utf-8")
    assert unit["Service"]["ExecStart"].endswith("/hybridmpm serve")
    image = (DEPLOY / "Dockerfile").read_text("utf-8")
    assert "USER 10001" in image
    assert "HYBRIDMPM_KEYS=/run/secrets/keys" in image
    for copied in ("service/requirements.txt", "./service"):
        assert copied in image

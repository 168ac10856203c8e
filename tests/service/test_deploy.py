"""The files for operators: calls through the proxy, and what their readers say of the others."""

import configparser
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
import yaml
from tests.service.conftest import WAIT_SECONDS, Service, Stream
from websockets.sync.client import connect

DEPLOY = Path(__file__).parents[2] / "service" / "deploy"


@pytest.fixture
def proxy(start: Callable[..., Service]) -> Iterator[tuple[Service, str]]:
    """Return a service, and the address of HAProxy before it."""
    haproxy = shutil.which("haproxy", path=f"{os.environ['PATH']}:/usr/sbin")
    if haproxy is None:
        assert "CI" not in os.environ, "HAProxy is missing: apt-get install haproxy"
        pytest.skip("needs HAProxy: apt-get install haproxy")
    service = start(allowed_hosts=("proxy.example", "localhost", "127.0.0.1"))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    environment = os.environ | {"NODE": service.address, "LISTEN": address}
    with subprocess.Popen([haproxy, "-db", "-f", DEPLOY / "haproxy.cfg"], env=environment) as process:
        try:
            deadline = time.monotonic() + WAIT_SECONDS
            while True:
                assert time.monotonic() < deadline
                assert process.poll() is None
                try:
                    if httpx.get(f"http://{address}/livez", headers={"Host": "proxy.example"}).is_success:
                        break
                except httpx.TransportError:
                    pass
                time.sleep(0.05)
            yield service, address
        finally:
            process.kill()


def test_calls_and_streams_pass_the_proxy_and_metrics_do_not(proxy: tuple[Service, str]) -> None:
    service, address = proxy
    path = service.create()
    headers = {"Host": "proxy.example", "X-Forwarded-For": "203.0.113.9"}
    with httpx.Client(base_url=f"http://{address}", headers=headers, timeout=WAIT_SECONDS) as client:
        assert client.get("/").status_code == 200
        assert client.get("/metrics").status_code == 404
        assert client.post(f"{path}/advance", json={"frames": 2}).json()["frame"] == 2
        origin = {"Origin": "http://proxy.example", "Host": "proxy.example"}
        assert client.post(f"{path}/advance", json={}, headers=origin).status_code == 200
    text = service.http.get("/metrics").text
    assert 'route="/v1/sessions/{session_id}/advance",status="200"} 2.0' in text
    with connect(f"ws://{address}{path}/stream", additional_headers={"X-Request-ID": "w"}) as socket_:
        stream = Stream(socket_)
        stream.send(type="play")
        assert stream.reach(5).number >= 5


def test_the_other_files_are_read() -> None:
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text("utf-8"))
    assert compose["services"]["hybridmpm"]["read_only"] is True
    assert set(compose["volumes"]) == {"state"}
    unit = configparser.RawConfigParser(strict=True)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read(DEPLOY / "hybridmpm.service", encoding="utf-8")
    assert unit["Service"]["ExecStart"].endswith("/hybridmpm serve")
    image = (DEPLOY / "Dockerfile").read_text("utf-8")
    assert "USER 10001" in image
    for copied in ("service/requirements.txt", "./service"):
        assert copied in image

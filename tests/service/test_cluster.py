"""Two nodes behind HAProxy: each session has an owner, whom the proxy finds by its name."""

import asyncio
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS, Service, Stream, problem
from websockets.sync.client import connect

from hybridmpm import ConfigError
from hybridmpm_service.http.answers import SessionBody
from hybridmpm_service.http.peers import Peers
from hybridmpm_service.keys.file import add

DEPLOY = Path(__file__).parents[2] / "service" / "deploy"


def free() -> str:
    """Return an address that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{probe.getsockname()[1]}"


class Node:
    """A process of the service that may be killed and started again."""

    def __init__(self, name: str, address: str, folder: Path, peer: str, *more: str) -> None:
        flags = ["--port", address.partition(":")[2], "--node", name, "--state-folder", str(folder / name)]
        flags += ["--peers", peer, "--max-load", "64", *more]
        self._command = [sys.executable, "-m", "hybridmpm_service", *flags]
        self.url = f"http://{address}"
        self.start()

    def start(self) -> None:
        """Start the process, and wait until it answers."""
        self.process = subprocess.Popen(self._command, stdout=subprocess.DEVNULL)
        until(lambda: answers(f"{self.url}/livez"))

    def end(self, number: signal.Signals = signal.SIGKILL) -> None:
        """End the process by a signal."""
        self.process.send_signal(number)
        self.process.wait(WAIT_SECONDS)


def answers(url: str) -> bool:
    """Return whether a GET succeeds."""
    try:
        return httpx.get(url, timeout=WAIT_SECONDS).is_success
    except httpx.TransportError:
        return False


def until(happened: Callable[[], object]) -> None:
    """Wait for what has no event."""
    deadline = time.monotonic() + WAIT_SECONDS
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.05)


class Cluster:
    """Two nodes, and a proxy before them."""

    def __init__(self, stack: ExitStack, folder: Path, haproxy: str, *flags: str) -> None:
        places = {"00": free(), "01": free()}
        peers = {"00": f"01=http://{places['01']}", "01": f"00=http://{places['00']}"}
        self.nodes = {}
        for name, place in places.items():
            self.nodes[name] = node = Node(name, place, folder, peers[name], *flags)
            stack.callback(node.end)
        self.address = free()
        self._environment = os.environ | {f"NODE_{name}": place for name, place in places.items()}
        self._haproxy = haproxy
        self.proxy = self.start_proxy()
        stack.callback(self.end_proxy)
        self.http = httpx.Client(base_url=f"http://{self.address}", timeout=WAIT_SECONDS)
        stack.callback(self.http.close)
        until(lambda: answers(f"http://{self.address}/readyz"))

    def start_proxy(self) -> "subprocess.Popen[bytes]":
        """Start HAProxy."""
        environment = self._environment | {"LISTEN": self.address}
        files = (part for name in ("common", "cluster") for part in ("-f", DEPLOY / f"{name}.cfg"))
        return subprocess.Popen([self._haproxy, "-db", *files], env=environment)

    def end_proxy(self) -> None:
        """Kill HAProxy."""
        self.proxy.kill()
        self.proxy.wait(WAIT_SECONDS)

    def create(self, **headers: str) -> str:
        """Create a session through the proxy and return its name."""
        answer = self.http.post("/v1/sessions", json={"scene": SMALL_SCENE}, headers=headers)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    def owner(self) -> str:
        """Return the node that takes a new session, or nothing where the proxy has to look again first."""
        answer = self.http.post("/v1/sessions", json={"scene": SMALL_SCENE})
        return str(answer.json().get("id", ""))[:2]

    def digest(self, name: str) -> str:
        """Return the digest of a session's state."""
        return str(self.http.get(f"/v1/sessions/{name}/log").json()["digest"])


@pytest.fixture
def start_cluster(tmp_path: Path) -> Iterator[Callable[..., Cluster]]:
    """Return a function that starts two nodes, with more flags, behind HAProxy."""
    haproxy = shutil.which("haproxy", path=f"{os.environ['PATH']}:/usr/sbin")
    if haproxy is None:
        assert "CI" not in os.environ, "HAProxy is missing: apt-get install haproxy"
        pytest.skip("needs HAProxy: apt-get install haproxy")
    with ExitStack() as stack:
        yield lambda *flags: Cluster(stack, tmp_path, haproxy, *flags)


@pytest.fixture
def cluster(start_cluster: Callable[..., Cluster]) -> Cluster:
    """Return two nodes behind HAProxy."""
    return start_cluster()


def test_a_node_that_is_killed_loses_nothing_and_the_other_goes_on(cluster: Cluster) -> None:
    names = [cluster.create() for _ in range(8)]
    owners = {name: name[:2] for name in names}
    assert set(owners.values()) == {"00", "01"}, "new sessions go to both nodes"
    for name in names:
        cluster.http.post(f"/v1/sessions/{name}/advance", json={"frames": 3})
    digests = {name: cluster.digest(name) for name in names}
    one = {cluster.create(**{"Idempotency-Key": "twice"}) for _ in range(6)}
    assert len(one) == 1, "a key meets its node again"

    cluster.end_proxy()
    cluster.proxy = cluster.start_proxy()
    until(lambda: answers(f"http://{cluster.address}/readyz"))
    assert {name: cluster.digest(name) for name in names} == digests, "the proxy keeps nothing"

    cluster.nodes["01"].end()
    lost = [name for name in names if owners[name] == "01"]
    kept = [name for name in names if owners[name] == "00"]
    until(lambda: cluster.http.get(f"/v1/sessions/{lost[0]}").status_code == 503)
    answer = cluster.http.get(f"/v1/sessions/{lost[0]}")
    assert int(answer.headers["Retry-After"]) > 0
    assert cluster.digest(kept[0]) == digests[kept[0]]
    assert cluster.create()[:2] == "00"
    listed = cluster.http.get("/v1/sessions").json()
    assert listed["missing_nodes"] == ["01"]
    assert {body["id"] for body in listed["sessions"]} >= set(kept)

    cluster.nodes["01"].start()
    until(lambda: all(cluster.http.get(f"/v1/sessions/{name}").is_success for name in lost))
    assert {name: cluster.digest(name) for name in names} == digests
    listed = cluster.http.get("/v1/sessions").json()
    assert listed["missing_nodes"] == []
    assert {body["id"] for body in listed["sessions"]} >= set(names)


def test_a_node_is_drained_and_its_sessions_move(cluster: Cluster) -> None:
    name = cluster.create()
    old, new = name[:2], "01" if name.startswith("00") else "00"
    cluster.http.post(f"/v1/sessions/{name}/advance", json={"frames": 5})
    cluster.nodes[old].process.send_signal(signal.SIGUSR1)
    until(lambda: not answers(f"{cluster.nodes[old].url}/readyz"))
    until(lambda: {cluster.owner() for _ in range(3)} == {new})
    with connect(f"ws://{cluster.address}/v1/sessions/{name}/stream", compression=None) as connection:
        stream = Stream(connection)
        stream.send(type="play")
        assert stream.reach(8).number >= 8, "what was there goes on"
        stream.send(type="pause")
        stream.status(playing=False)
    log = cluster.http.get(f"/v1/sessions/{name}/log").json()
    moved = cluster.http.post("/v1/sessions", json={"log": log}).json()
    assert moved["id"][:2] == new
    assert moved["notice"] is None
    assert cluster.digest(moved["id"]) == log["digest"]
    cluster.http.delete(f"/v1/sessions/{name}")
    cluster.nodes[old].end(signal.SIGTERM)
    assert cluster.digest(moved["id"]) == log["digest"]


@pytest.mark.long
def test_keys_hold_in_all_nodes_and_after_a_crash(
    start_cluster: Callable[..., Cluster], tmp_path: Path
) -> None:
    tokens = {name: add(tmp_path / "keys", name, "view,steer,create") for name in ("anna", "bob")}
    cluster = start_cluster("--keys", str(tmp_path / "keys"))
    anna, bob = ({"Authorization": f"Bearer {tokens[name]}"} for name in ("anna", "bob"))
    names = [cluster.create(**anna) for _ in range(4)]
    assert {name[:2] for name in names} == {"00", "01"}
    other = cluster.create(**bob)

    def listed(headers: dict[str, str]) -> set[str]:
        answer = cluster.http.get("/v1/sessions", headers=headers).json()
        assert answer["missing_nodes"] == []
        return {body["id"] for body in answer["sessions"]}

    assert listed(anna) == set(names)
    assert listed(bob) == {other}
    assert cluster.http.get("/v1/sessions").status_code == 401
    for written in (names[0], names[0].replace("0", "%30"), f"%2e/{names[0]}", f"x/../{names[0]}"):
        address = f"http://{cluster.address}/v1/sessions/{written}"
        assert raw(address, bob) in {404, 421}, written
        assert raw(address, {}) == 401, written
    assert raw(f"http://{cluster.address}/v1/sessions/{names[0].replace('0', '%30')}", anna) == 200
    path, node = f"/v1/sessions/{names[0]}", cluster.nodes[names[0][:2]]
    links = []
    for _ in range(2):
        links.append(cluster.http.post(f"{path}/links", json={}, headers=anna).json()["token"])
        if len(links) == 1:
            cluster.http.delete(f"{path}/links", headers=anna)
    node.end()
    node.start()
    until(lambda: cluster.http.get(path, headers=anna).is_success)
    assert cluster.http.get(path, headers=anna).json()["key"] == "anna"
    assert cluster.http.get(path, headers=bob).status_code == 404
    taken_back, kept = ({"Authorization": f"Bearer {link}"} for link in links)
    assert cluster.http.get(path, headers=taken_back).status_code == 401
    assert cluster.http.get(path, headers=kept).status_code == 200
    assert cluster.http.get(f"/v1/sessions/{names[1]}", headers=kept).status_code == 404


def raw(address: str, headers: dict[str, str]) -> int:
    """Return the status of a GET whose path is sent as it is written."""
    host, _, path = address.removeprefix("http://").partition("/")
    connection = HTTPConnection(host, timeout=WAIT_SECONDS)
    connection.request("GET", f"/{path}", headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


def test_a_node_owns_what_begins_with_its_name(start: Callable[..., Service]) -> None:
    service = start(node="0a")
    path = service.create()
    assert path.rpartition("/")[2].startswith("0a")
    job: dict[str, Any] = service.http.post(f"{path}/recordings", json={"frames": 1, "format": "npz"}).json()
    assert job["id"].startswith("0a")
    service.ended(job)
    for address in (f"/v1/sessions/0b{'0' * 30}", f"/v1/jobs/0b{'0' * 30}"):
        body = problem(service.http.get(address), 421)
        assert "is of node 0b, and this is node 0a" in body["detail"]
    problem(service.http.get(f"/v1/sessions/0a{'0' * 30}"), 404)
    problem(service.http.get(f"/v1/jobs/0a{'0' * 30}"), 410)


@pytest.mark.parametrize("text", ["01", "01=10.0.0.2:8000", "1=http://a", "=http://a"])
def test_peers_have_names_and_addresses(text: str) -> None:
    with pytest.raises(ConfigError, match="a peer is written 01=http://host:port"):
        Peers([text])


def test_a_peer_that_is_no_service_is_missing(service: Service) -> None:
    peers = Peers([f"01=http://{service.address}/v1/scenarios", f"02=http://{service.address}"])
    path = service.create()
    rows, missing = asyncio.run(peers.rows("sessions", SessionBody))
    assert missing == ["01"]
    assert path in {row.links["self"] for row in rows}


FOREIGN = [
    b"",
    b"null",
    b"[]",
    b"{}",
    b'{"sessions": 1}',
    b'{"sessions": [{"id": "a"}]}',
    b"\xff",
    b'{"jobs": []}',
]


def test_a_peer_with_a_foreign_answer_is_missing(start: Callable[..., Service]) -> None:
    bodies = list(FOREIGN)

    class Foreign(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Length", str(len(bodies[0])))
            self.end_headers()
            self.wfile.write(bodies[0])

        def log_message(self, *_: object) -> None:
            """Write nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Foreign) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        service = start(node="00", peers=(f"01=http://127.0.0.1:{server.server_port}",))
        path = service.create()
        while bodies:
            listed = service.http.get("/v1/sessions")
            assert listed.status_code == 200, bodies[0]
            assert listed.json()["missing_nodes"] == ["01"]
            assert path in listed.text
            del bodies[0]
        server.shutdown()

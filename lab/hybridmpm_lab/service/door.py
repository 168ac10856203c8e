"""What keys and a proxy cost: the same calls without keys, with keys, and through HAProxy, in turn."""

import http.client
import json
import os
import random
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from websockets.sync.client import connect

from hybridmpm.client import Client
from hybridmpm.errors import SimulationError
from hybridmpm_lab.service.server import Server, running
from hybridmpm_lab.service.viewers import WAIT
from hybridmpm_service.keys.file import add

_KEYS = 100
"""Keys in the file; the last one is used."""
_DEPLOY = Path(__file__).parents[3] / "service" / "deploy"
_SPEEDS = (0.2, 0.3)
_PAUSE = 0.006
"""Pause after a round [s]: the proxy refuses more than 200 calls a second of an address."""
_FAST = ("--max-messages-per-second", "100000", "--max-messages-at-once", "100000")


def costs(repeats: int) -> Iterator[tuple[str, float, float | None]]:
    """Yield measures of the door, with their values [ms] and aims.

    Each of `repeats` rounds makes a call in each way, in random order; so it is with commands of a stream.

    Raises
    ------
    SimulationError
        HAProxy is missing, or a service or the proxy does not answer.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        token = [add(folder / "keys", f"key-{number}", "view,steer,create") for number in range(_KEYS)][-1]
        plain = stack.enter_context(running(*_FAST))
        keyed = stack.enter_context(running(*_FAST, "--keys", str(folder / "keys")))
        ways = {
            "without keys": (plain.port, None, plain),
            "with keys": (keyed.port, token, keyed),
            "through HAProxy": (stack.enter_context(proxied(plain)), None, plain),
            "with keys through HAProxy": (stack.enter_context(proxied(keyed)), token, keyed),
        }
        paths = {}
        for name, (_, key, server) in ways.items():
            with Client(server.address, key=key) as client:
                paths[name] = f"/v1/sessions/{client.create('water_2d').id}"
        for what, way in (("GET of a session", calling), ("command of a stream to its status", commanding)):
            # Streams are opened when they are read: one that nobody reads is closed.
            with ExitStack() as opened:
                each = {
                    name: opened.enter_context(way(port, paths[name], key))
                    for name, (port, key, _) in ways.items()
                }
                times = timed(each, repeats)
            for name in ways:
                yield f"{what} {name}, lower quartile", times[name], None
            aim = 0.2 if way is calling else None
            yield f"{what}, added by keys", times["with keys"] - times["without keys"], aim
            yield f"{what}, added by HAProxy", times["through HAProxy"] - times["without keys"], None


def timed(ways: dict[str, Callable[[], None]], repeats: int) -> dict[str, float]:
    """Return the lower quartile of the times of each call [ms]; they are made in turn, in random order."""
    order, found = random.Random(0), {name: list[float]() for name in ways}
    for number in range(repeats + 10):
        for name in order.sample(list(ways), len(ways)):
            start = time.perf_counter()
            ways[name]()
            # The first ones open connections and fill caches.
            if number >= 10:
                found[name].append(1e3 * (time.perf_counter() - start))
        time.sleep(_PAUSE)
    return {name: float(np.percentile(times, 25)) for name, times in found.items()}


@contextmanager
def calling(port: int, path: str, key: str | None) -> Iterator[Callable[[], None]]:
    """Return a function that makes a call on a connection that is kept."""
    headers = {} if key is None else {"Authorization": f"Bearer {key}"}
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT)

    def call() -> None:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        answer.read()
        if answer.status != 200:
            raise SimulationError(f"the service answers {answer.status}")

    try:
        yield call
    finally:
        connection.close()


@contextmanager
def commanding(port: int, path: str, key: str | None) -> Iterator[Callable[[], None]]:
    """Return a function that sets the speed of a session's player, and waits for the status that says so."""
    headers = {} if key is None else {"Authorization": f"Bearer {key}"}
    address = f"ws://127.0.0.1:{port}{path}/stream?version=2"
    with connect(address, compression=None, proxy=None, additional_headers=headers) as stream:
        turn = 0

        def command() -> None:
            nonlocal turn
            turn += 1
            speed = _SPEEDS[turn % 2]
            stream.send(json.dumps({"type": "speed", "value": speed}))
            while True:
                message = stream.recv(timeout=WAIT)
                told: dict[str, Any] = json.loads(message) if isinstance(message, str) else {"type": "frame"}
                if told["type"] == "status" and told["session"]["speed"] == speed:
                    return

        yield command


@contextmanager
def proxied(server: Server) -> Iterator[int]:
    """Start HAProxy with the configuration for operators before a server, and yield its port.

    Raises
    ------
    SimulationError
        It is missing, or does not listen.
    """
    haproxy = shutil.which("haproxy", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
    if haproxy is None or not _DEPLOY.is_dir():
        raise SimulationError(
            "this needs HAProxy (apt-get install haproxy) and the repository's service/deploy"
        )
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    environment = os.environ | {"NODE": f"127.0.0.1:{server.port}", "LISTEN": f"127.0.0.1:{port}"}
    files = [part for name in ("common", "haproxy") for part in ("-f", str(_DEPLOY / f"{name}.cfg"))]
    with subprocess.Popen([haproxy, "-db", *files], env=environment) as process:  # noqa: S603
        try:
            deadline = time.monotonic() + WAIT
            while True:
                if process.poll() is not None or time.monotonic() > deadline:
                    raise SimulationError("HAProxy does not listen; see above")
                try:
                    socket.create_connection(("127.0.0.1", port)).close()
                    break
                except OSError:
                    time.sleep(0.05)
            yield port
        finally:
            process.kill()

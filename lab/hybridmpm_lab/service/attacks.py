"""Attacks on the service, each beside a bystander: what it waits for is compared with a calm time before.

All clients have the address of the bystander, and a connection for each call: the worst case for its share.
"""

import asyncio
import itertools
import json
import socket
import subprocess
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException
from websockets.protocol import State

from hybridmpm.errors import SimulationError
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.service.bystander import Wait, standing_by
from hybridmpm_lab.service.server import Server, running
from hybridmpm_lab.service.viewers import WAIT

CUT = 0
"""Status of a call whose connection ended before the answer."""
_AHEAD_SECONDS = 1.0  # An attack has lasted so long when the bystander's waits begin to count
_SLOW_BYTES, _SLOW_SECONDS = 1024, 1.0  # A slow reader takes so many bytes in each such time


def _request(method: str, path: str, body: bytes = b"", head: str = "Connection: close") -> bytes:
    size = f"\r\nContent-Length: {len(body)}" if head.endswith("close") else ""
    lines = (f"{method} {path} HTTP/1.1", "Host: 127.0.0.1", "Content-Type: application/json", head + size)
    return "\r\n".join((*lines, "", "")).encode() + body


def _post(path: str, **body: Any) -> bytes:
    return _request("POST", path, json.dumps(body).encode())


class Target:
    """Server under attack, with a session of water_3d, and how it answers."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self.path = ""
        """Path of the session."""
        self.log: Row = {}
        """Log of the session."""
        self.statuses: Counter[int] = Counter()
        """Statuses of calls, and codes with which streams were closed."""
        self.faults: list[str] = []
        """Answers of status 500 and above without `Retry-After`."""

    async def prepare(self) -> None:
        """Create the session."""
        made = json.loads(await self.call(_post("/v1/sessions", scenario="water_3d")))
        self.path = made["links"]["self"]
        self.log = json.loads(await self.call(_request("GET", made["links"]["log"])))
        self.statuses.clear()

    async def crowd(self, count: int, *requests: bytes, pause: float = 0.001, **options: Any) -> None:
        """Let clients call at once, in turn and again and again; they delete the sessions that they make."""
        waiting = itertools.cycle(requests)

        async def come_and_go() -> None:
            while True:
                request = next(waiting)
                answer = await self.call(request, **options)
                if request.startswith(b"POST /v1/sessions ") and answer.startswith(b'{"id"'):
                    await self.call(_request("DELETE", json.loads(answer)["links"]["self"]))
                await asyncio.sleep(pause)

        await asyncio.gather(*(come_and_go() for _ in range(count)))

    async def call(self, request: bytes, *, patience: float | None = None, slow: bool = False) -> bytes:
        """Send a request on a connection of its own; return the body of the answer, b"" without one.

        The client leaves after `patience` [s]; where it is slow it takes a kilobyte a second.
        """
        answer = b""

        async def read(reader: asyncio.StreamReader) -> None:
            nonlocal answer
            while part := await reader.read(_SLOW_BYTES if slow else 1 << 16):
                if not answer:
                    self._note(request, part)
                answer += part
                await asyncio.sleep(_SLOW_SECONDS if slow else 0)

        with socket.socket() as line:
            if slow:
                line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            line.setblocking(False)  # noqa: FBT003 - the only form it has
            with suppress(ConnectionError, TimeoutError):
                await asyncio.get_running_loop().sock_connect(line, ("127.0.0.1", self.server.port))
                reader, writer = await asyncio.open_connection(sock=line, limit=_SLOW_BYTES)
                writer.write(request)
                try:
                    await asyncio.wait_for(read(reader), patience)
                finally:
                    writer.transport.abort()
                    if not answer and patience is None:
                        self.statuses[CUT] += 1
        return answer.partition(b"\r\n\r\n")[2]

    def _note(self, request: bytes, answer: bytes) -> None:
        """Count the status of an answer, whose headers arrive in one piece."""
        status = int(answer.split(b" ", 2)[1])
        self.statuses[status] += 1
        if status >= 500 and b"\r\nretry-after:" not in answer.lower():
            self.faults.append(f"{request[:80]!r}: {answer[:300]!r}")

    async def flood(self, rate: float, first: bytes, then: bytes) -> None:
        """Send frames to the stream of the session at so many bytes a second, anew whenever it is closed."""
        while True:
            with suppress(OSError, WebSocketException):
                uri = f"ws://127.0.0.1:{self.server.port}{self.path}/stream"
                async with connect(uri, compression=None, proxy=None, close_timeout=1.0) as stream:
                    stream.transport.write(first)
                    while stream.state is State.OPEN:
                        stream.transport.write(then)
                        await asyncio.sleep(len(then) / rate)
                    await stream.wait_closed()
                self.statuses[stream.close_code or CUT] += 1


class Attack(NamedTuple):
    """An attack, and how the service has to answer it."""

    must: int | None
    """Status that its clients have to get within a minute; None where it may take longer."""
    may: tuple[int, ...]
    """Other statuses that they may get, besides 503."""
    run: Callable[[Target], Awaitable[object]]
    """Attacks until it is cancelled."""


async def _large_bodies(target: Target) -> None:
    paths = ["/v1/plans", "/v1/sessions", "/v1/checks", "/v1/datasets"]
    paths += [f"{target.path}/{name}" for name in ("advance", "sketches", "trajectories", "recordings")]
    bodies = (
        b'{"scene":{"dim":2,"bodies":[' + b"{}," * 690_000 + b"{}]}}",
        b"[" * (2 << 20),
        *(b'{"scenario":"' + b"x" * size + b'"}' for size in (2_000_000, 3_000_000)),
    )
    await target.crowd(4, *(_request("POST", path, body) for path in paths for body in bodies))


def _long_log(target: Target) -> bytes:
    """Return the creation of a session from a log of 15 000 pushes."""
    push = {"point": [0.4, 0.2, 0.5], "velocity": [1, 0, 0], "radius": 0.1, "cap": 15}
    log = target.log | {"frame": 1, "inputs": [{"kind": "push", "frame": 0, "push": push}] * 15_000}
    return _post("/v1/sessions", log=log)


async def _downloads(target: Target) -> None:
    made = json.loads(await target.call(_long_log(target)))
    await target.crowd(8, _request("GET", made["links"]["log"]))


async def _sketches(target: Target) -> None:
    """Draw sketches that newer ones replace; most clients leave before theirs is planned."""
    arrow = {"kind": "arrow", "points": [[0.3, 0.5], [0.6, 0.7]]}
    sketch = _post(f"{target.path}/sketches", strokes=[arrow])
    await asyncio.gather(target.crowd(30, sketch, patience=0.05), target.crowd(10, sketch))


async def _listeners(target: Target) -> None:
    job = json.loads(await target.call(_post(f"{target.path}/recordings", frames=2000)))
    await target.crowd(400, _request("GET", job["links"]["events"]))


def _replays(**log: Any) -> Callable[[Target], Awaitable[object]]:
    return lambda to: to.crowd(6, _post("/v1/sessions", log=to.log | log))


def _checks(resolution: int, obstacles: Sequence[Row]) -> Callable[[Target], Awaitable[object]]:
    """Return seven clients that check a scene, of whom six leave after half a second."""
    water = {"shape": "ball", "center": [0.3, 0.3, 0.3], "radius": 0.01, "material": "water"}
    scene = {"dim": 3, "resolution": resolution, "bodies": [water], "obstacles": obstacles}
    check = _post("/v1/checks", scene=scene)
    return lambda to: asyncio.gather(to.crowd(6, check, patience=0.5), to.crowd(1, check))


def _flood(rate: float, frame: bytes, first: bytes = b"") -> Callable[[Target], Awaitable[object]]:
    """Return a client that sends frames without content."""
    empty = b"\x80\0\0\0\0"
    return lambda to: to.flood(rate, first and first + empty, 400 * (frame + empty))


_BALL = {"shape": "ball", "center": [0.5, 0.5, 0.5], "radius": 0.05}
_TURNING = {"angular_velocity": [1, 1, 1], "center": [0.5, 0.5, 0.5]}
_CYLINDER = {"shape": "cylinder", "end": [0.8, 0.7, 0.6], "radius": 0.05, "motion": _TURNING}
_CYLINDERS = [_CYLINDER | {"start": [0.2, 0.2, 0.2 + 0.0005 * place]} for place in range(1000)]
_PLAN = _post("/v1/plans", scenario="water_3d", seed=1, budget_ms=1.0)
_DATASET = _post("/v1/datasets", scenario="water_2d", trajectories=50, frames=300)
_CREATE, _CHECK = (_post(f"/v1/{name}", scenario="water_3d") for name in ("sessions", "checks"))
_CHUNKS = _request("POST", "/v1/sessions", 400_000 * b"1\r\n \r\n", "Transfer-Encoding: chunked")
_FILM: Row = {"frames": 2000, "format": "gif"}
_PLAY = b'\x81\xfe\x00\x0f\0\0\0\0{"type":"play"}'
_STREAM = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
_STREAM += "dGhlIHNhbXBsZSBub25jZQ=="
ATTACKS = {
    "bodies of 2 and 3 MB on 4 connections": Attack(422, (413, CUT), _large_bodies),
    "60 clients with valid plans": Attack(200, (), lambda to: to.crowd(60, _PLAN)),
    "6 logs of 20 000 frames": Attack(None, (201, 204), _replays(frame=20_000)),
    "6 logs with a wrong digest": Attack(None, (201, 204), _replays(frame=50, digest="0" * 64)),
    "6 clients that create and check": Attack(201, (200, 204), lambda to: to.crowd(6, _CREATE, _CHECK)),
    "checks of 1000 turning cylinders": Attack(None, (200,), _checks(160, _CYLINDERS)),
    "checks of 40 balls in 128^3 nodes": Attack(None, (200,), _checks(128, [_BALL] * 40)),
    "empty pongs at 1 MB/s": Attack(1008, (1006,), _flood(1e6, b"\x8a")),
    "empty pongs at 2.4 MB/s": Attack(1008, (1006,), _flood(2.4e6, b"\x8a")),
    "empty continuations at 2.4 MB/s": Attack(1008, (1006,), _flood(2.4e6, b"\0", first=b"\x01")),
    "chunks of a byte": Attack(400, (CUT,), lambda to: to.crowd(1, _CHUNKS)),
    "14 films": Attack(202, (), lambda to: to.crowd(14, _post(f"{to.path}/recordings", **_FILM), pause=5)),
    "14 data sets": Attack(202, (), lambda to: to.crowd(14, _DATASET, pause=5)),
    "8 downloads of a log of 15 000 inputs": Attack(200, (201,), _downloads),
    "8 clients that send such a log": Attack(201, (204,), lambda to: to.crowd(8, _long_log(to))),
    "40 clients whose sketches are replaced": Attack(None, (200, 409, CUT), _sketches),
    "400 calls at once, again and again": Attack(
        200, (), lambda to: to.crowd(400, _request("GET", to.path), pause=0.5)
    ),
    "300 slow readers of particles": Attack(
        200, (CUT,), lambda to: to.crowd(300, _request("GET", f"{to.path}/particles"), pause=1, slow=True)
    ),
    "400 listeners of a job": Attack(200, (202,), _listeners),
    "a viewer at 1 KB/s": Attack(
        101, (CUT,), lambda to: to.crowd(1, _request("GET", f"{to.path}/stream", _PLAY, _STREAM), slow=True)
    ),
}


class Figure(NamedTuple):
    """A figure of an attack."""

    measure: str
    value: float | None
    calm: float | None
    """Its value before the attack."""
    unit: str
    aim: float


def attacked(attack: Attack, seconds: float) -> list[Figure]:
    """Attack a new server for some seconds [s], after as long a calm, and stop it amid the attack.

    Raises
    ------
    SimulationError
        The attack is not answered as it should be; a call of the bystander is refused, or takes more than a
        minute; or the server does not end within a minute.
    """
    with running() as server, standing_by(server.address) as end:
        return asyncio.run(_attacked(attack, Target(server), seconds, end))


async def _attacked(
    attack: Attack, target: Target, seconds: float, end: Callable[[], list[Wait]]
) -> list[Figure]:
    await target.prepare()
    await asyncio.sleep(seconds)
    began = time.perf_counter()
    attacking = asyncio.ensure_future(attack.run(target))
    await asyncio.wait((attacking,), timeout=_AHEAD_SECONDS + seconds)
    ended = time.perf_counter()
    with suppress(TimeoutError):
        async with asyncio.timeout(WAIT):
            while attack.must not in {None, *target.statuses}:  # noqa: ASYNC110 - it has no event
                await asyncio.sleep(0.05)
    if attacking.done():
        attacking.result()
    waits = await asyncio.to_thread(end)
    got, memory = dict(target.statuses), target.server.memory("VmHWM")
    if target.faults or not set(got) <= {attack.must, *attack.may, 503} or attack.must not in {None, *got}:
        raise SimulationError(f"the service answers an attack with {got} {' '.join(target.faults[:3])}")
    stopped = time.perf_counter()
    target.server.process.terminate()
    try:
        await asyncio.to_thread(target.server.process.wait, WAIT)
    except subprocess.TimeoutExpired:
        raise SimulationError(f"the service does not end within {WAIT:g} s amid an attack") from None
    end_seconds = time.perf_counter() - stopped
    attacking.cancel()
    await asyncio.gather(attacking, return_exceptions=True)

    def figure(kind: str, share: float) -> tuple[float, float]:
        beside = [
            one for one in waits if began + _AHEAD_SECONDS < one.start + one.seconds and one.start < ended
        ]
        calm = [one for one in waits if one.start + one.seconds < began]
        each = ([1e3 * one.seconds for one in some if one.kind == kind] for some in (beside, calm))
        value, before = (float(np.percentile(some, share)) for some in each)
        return value, before

    return [
        Figure("GET p99", *figure("GET", 99), "ms", 20.0),
        Figure("POST worst", *figure("POST", 100), "ms", 300.0),
        Figure("frame interval p99", *figure("frame", 99), "ms", 100.0),
        Figure("memory", None if memory is None else memory / 2**20, None, "MiB", 512.0),
        Figure("end on SIGTERM", end_seconds, None, "s", 2.0),
    ]

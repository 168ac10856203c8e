"""Kills of the service at random moments under load, each compared with uninterrupted runs to the bit."""

import asyncio
import contextlib
import json
import random
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
from websockets.exceptions import WebSocketException

from hybridmpm import Scene
from hybridmpm.client import AsyncClient, AsyncSession, AsyncStream, ServiceError
from hybridmpm.errors import SimulationError
from hybridmpm_lab.service.server import Server, running
from hybridmpm_lab.service.viewers import WAIT
from hybridmpm_service.http.logs import LogBody
from hybridmpm_service.sessions.journal import Journal
from hybridmpm_service.sessions.revival import replay
from hybridmpm_service.sessions.simulation import Simulation
from hybridmpm_service.sessions.solvers import SolverFactory

_WATER = {"shape": "box", "lower": [0.4, 0.4], "upper": [0.5, 0.5], "material": "water"}
_SCENE = {"dim": 2, "resolution": 32, "bodies": [_WATER | {"upper": [0.6, 0.6]}]}
_EMITTER = {"shape": "rectangle", "lower": [0.1, 0.6], "upper": [0.1, 0.7], "material": "sand"}
_SINK = {"shape": "box", "lower": [0.4, 0.0], "upper": [0.6, 0.1]}
_BODIES: tuple[dict[str, Any], ...] = (
    {"scene": _SCENE},
    {"scene": _SCENE | {"emitters": [_EMITTER | {"velocity": [2.0, 0.0]}], "sinks": [_SINK]}},
    {"scene": _SCENE, "coarse": "1/4"},
    {"scene": _SCENE | {"resolution": 128, "bodies": [_WATER]}, "solver": "hybrid", "model": "fluids_2d"},
)
"""Sessions of a run: MPM, emitters and a sink, the coarse mode, and the hybrid."""
_ARROW = [[0.5, 0.5], [0.6, 0.55]]
_MOST_SESSIONS = 8
_KILLS_OF_A_RUN = 5


@dataclass
class Outcome:
    """Count of what was compared, and of what differed."""

    kills: int = 0
    logs: int = 0
    """Logs whose states were computed again without an interruption."""
    frames: int = 0
    """Their frames."""
    inputs: int = 0
    """Their inputs."""
    differing: int = 0
    """Logs whose digest is not that of the uninterrupted run."""
    lost: int = 0
    """Sessions, frames, inputs and deletions that were acknowledged, and gone after a restart."""
    restarts: list[float] = field(default_factory=list)
    """Times from the start of a process until all sessions answered [s]."""


@dataclass
class _Known:
    """Acknowledged part of a session."""

    frame: int = 0
    sketches: set[int] = field(default_factory=set)


@dataclass
class _Record:
    """Everything that the service has acknowledged in a run."""

    known: dict[str, _Known] = field(default_factory=dict)
    """Sessions by their ids."""
    gone: set[str] = field(default_factory=set)
    """Ids of deleted sessions."""
    logs: defaultdict[str, list[dict[str, Any]]] = field(default_factory=lambda: defaultdict(list))
    """All logs of each session, in their order, those of deleted ones as well."""


def kills(count: int, seed: int = 0, *, longest: float = 1.0) -> Outcome:
    """Kill the service some times at random moments, up to `longest` [s] after its clients began.

    Raises
    ------
    SimulationError
        The service does not start, or a session does not answer for a minute.
    """
    outcome, rng, solvers = Outcome(), random.Random(seed), SolverFactory(threads=1)
    while outcome.kills < count:
        with TemporaryDirectory() as folder:
            record = _Record()
            for left in range(min(_KILLS_OF_A_RUN, count - outcome.kills), -1, -1):
                start = time.perf_counter()
                with running("--state-folder", str(Path(folder) / "state")) as server:
                    asyncio.run(all_answer(server.address, list(record.known)))
                    outcome.restarts += [time.perf_counter() - start] if record.known else []
                    asyncio.run(_compare(server.address, record, outcome))
                    if left:
                        asyncio.run(_load(server, record, rng, rng.uniform(0.02, longest)))
                        outcome.kills += 1
            for logs in record.logs.values():
                _compute_again(logs, solvers, outcome)
    return outcome


async def all_answer(address: str, ids: Sequence[str]) -> None:
    """Wait until every session answers; raises a `ServiceError` where one is lost, or late by a minute."""
    end = time.perf_counter() + WAIT
    async with AsyncClient(address, timeout=WAIT) as client:
        for session_id in ids:
            while True:
                try:
                    await client.session(session_id)
                except ServiceError as error:
                    if error.status != httpx.codes.SERVICE_UNAVAILABLE or time.perf_counter() > end:
                        raise
                    await asyncio.sleep(0.005)
                else:
                    break


async def _compare(address: str, record: _Record, outcome: Outcome) -> None:
    """Count what was acknowledged and is gone; note the logs of all sessions."""
    async with AsyncClient(address, timeout=WAIT) as client:
        sessions = await client.sessions()
        outcome.lost += len(record.gone & {session.id for session in sessions})
        for session in sessions:
            log, before = await session.log(), record.known.setdefault(session.id, _Known())
            numbers = {one["number"] for one in log["inputs"] if one["kind"] == "sketch"}
            old = record.logs[session.id][-1]["inputs"] if record.logs[session.id] else []
            kept = (
                log["frame"] >= before.frame,
                before.sketches <= numbers,
                log["inputs"][: len(old)] == old,
            )
            outcome.lost += kept.count(False)
            record.known[session.id] = _Known(log["frame"], numbers)
            record.logs[session.id].append(log)


async def _load(server: Server, record: _Record, rng: random.Random, seconds: float) -> None:
    """Use sessions at random, and kill the server meanwhile."""
    async with AsyncClient(server.address, timeout=WAIT) as client:
        sessions = {session.id: session for session in await client.sessions()}
        for body in _BODIES if not sessions else ():
            session = await client.create(**body)
            sessions[session.id], record.known[session.id] = session, _Known()
        uses = [
            asyncio.create_task(_use(client, session, record, random.Random(rng.random())))
            for session in sessions.values()
        ]
        await asyncio.sleep(seconds)
        server.process.kill()
        await asyncio.gather(*uses)


async def _use(client: AsyncClient, session: AsyncSession, record: _Record, rng: random.Random) -> None:
    """Do what clients can do to a session, at random, until the server or the session is gone."""
    with contextlib.suppress(SimulationError, WebSocketException, OSError):
        async with session.stream() as stream:
            await stream.play()
            watching = asyncio.create_task(_watch(stream))
            while session.id in record.known and not watching.done():
                with contextlib.suppress(ServiceError):  # A sketch may replace another that is being planned.
                    await _act(client, session, stream, record, rng)
                await asyncio.sleep(rng.uniform(0.0, 0.03))
            watching.cancel()


async def _watch(stream: AsyncStream) -> None:
    """Read a stream to its end, which a client with unread frames would notice ten seconds late."""
    with contextlib.suppress(SimulationError):
        async for _ in stream:
            pass


async def _act(
    client: AsyncClient,
    session: AsyncSession,
    stream: AsyncStream,
    record: _Record,
    rng: random.Random,
) -> None:
    """Do one thing to a session, and note what is acknowledged."""
    kind, own = rng.random(), record.known[session.id]
    if kind < 0.4:
        await stream.push([rng.uniform(0.35, 0.65), 0.45], [rng.uniform(-2, 2), 1.0], 0.15)
    elif kind < 0.5:
        await stream.let_go()
    elif kind < 0.7:
        own.frame = max(own.frame, (await session.advance(rng.randint(1, 9)))["frame"])
    elif kind < 0.82:
        own.sketches.add((await session.steer(_ARROW, kind="arrow", frames=30))["number"])
    elif kind < 0.87:
        await session.release()
    elif kind < 0.93:
        log = await session.log()
        record.logs[session.id].append(log)
        own.frame = max(own.frame, log["frame"])
    elif len(record.known) < _MOST_SESSIONS:
        made = await (session.fork() if kind < 0.97 else client.create(**rng.choice(_BODIES)))
        record.known[made.id] = _Known()
    else:
        # Whether a deletion without an answer took place is open.
        name = rng.choice(list(record.known))
        del record.known[name]
        await (await client.session(name)).delete()
        record.gone.add(name)


def _compute_again(logs: Sequence[dict[str, Any]], solvers: SolverFactory, outcome: Outcome) -> None:
    """Compute a session again without an interruption, and compare its state at the end of each of its logs.

    The latest log has the inputs of all; whether it has is counted elsewhere.
    """
    longest = max(reversed(logs), key=lambda log: int(log["frame"]))
    scene = Scene.parse(longest["scene"])
    stored = LogBody.model_validate_json(json.dumps(longest)).log(scene, 10**9)
    origin = stored.origin
    chosen = solvers.make(origin.choice, origin.scene, origin.scenario)
    journal = Journal(stored.inputs, pending=len(stored.inputs))
    simulation = Simulation(chosen, clock=time.perf_counter, journal=journal)
    ends, digests = {log["frame"] for log in logs}, dict[int, str]()

    def look() -> None:
        if simulation.frame in ends - digests.keys():
            digests[simulation.frame] = simulation.particles().digest()

    replay(simulation, stored.inputs, stored.frame, check=look)
    look()
    outcome.logs += len(logs)
    outcome.frames += sum(log["frame"] for log in logs)
    outcome.inputs += sum(len(log["inputs"]) for log in logs)
    outcome.differing += sum(digests[log["frame"]] != log["digest"] for log in logs)

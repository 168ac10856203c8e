"""The measurements of the service, each against a running server."""

import asyncio
import random
import time
from collections.abc import Awaitable, Callable, Coroutine, Iterator, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import httpx
import numpy as np

from hybridmpm._support.machine import usable_cores
from hybridmpm.client import AsyncClient, AsyncSession
from hybridmpm.errors import SimulationError
from hybridmpm.stream_frames import Frame
from hybridmpm_lab.harness.command import setting
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.service.attacks import ATTACKS, attacked
from hybridmpm_lab.service.door import costs
from hybridmpm_lab.service.hostile import uploads
from hybridmpm_lab.service.kills import all_answer, kills
from hybridmpm_lab.service.line import ages
from hybridmpm_lab.service.server import Server, running
from hybridmpm_lab.service.sockets import arrivals
from hybridmpm_lab.service.viewers import WAIT, Viewer, playing, watching
from hybridmpm_lab.service.visit import visits

PARTS = ("intervals", "real-time", "sketch", "push", "hostile", "restart")
"""The measurements, in their order; the others have to be chosen: they take long, or need HAProxy."""
_SIZED = ("water_2d", "water_3d")
_SIZED_SESSIONS = 4
_SPEED = 0.25  # Simulated seconds per second at which frames are watched
_REAL_TIME: Row = {"coarse": "1/16"}
_REAL_TIME_SESSIONS = 8
_RESTING: Row = {
    "scene": {
        "name": "resting",
        "dim": 2,
        "gravity": [0.0, 0.0],
        "bodies": [{"shape": "box", "lower": [0.35, 0.35], "upper": [0.6, 0.6], "material": "water"}],
    }
}
"""Water in free space, about as many particles as in water_2d; it moves only when pushed."""


@dataclass(frozen=True, kw_only=True)
class ServiceSettings:
    """Size and length of the measurements."""

    part: tuple[str, ...] = setting(
        PARTS, "Part of the measurement.", (*PARTS, "sockets", "door", "sizes", "visit", "attacks", "kills")
    )
    sessions: tuple[int, ...] = setting(
        (1, 4, 16), "Number of sessions with one viewer each.", low=1, high=16
    )
    viewers: tuple[int, ...] = setting((1, 20, 100), "Number of viewers of one session.", low=1, high=500)
    kept: int = setting(8, "Number of sessions that are restored after a restart.", low=1, high=16)
    seconds: float = setting(20.0, "Length of each measurement of frames [s].", click.FloatRange(0.2, 3600))
    repeats: int = setting(20, "Number of sketches and of pushes.", low=1, high=1000)
    calls: int = setting(2000, "Number of calls and of commands in each way.", low=4, high=10**6)
    kills: int = setting(200, "Number of kills at random moments.", low=1, high=100_000)
    seed: int = setting(0, "Seed of the clients and the moments of kills.", low=0)

    @property
    def steps(self) -> int:
        """Number of parts."""
        return len(self.part)


def measure(settings: ServiceSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure a service on this machine, and yield the rows; `on_progress` counts parts.

    A row has `measure`, `sessions`, `viewers` (of each session), `value`, `unit`, and `aim`: the largest
    value, or for a time scale the least, that the service should reach; None where there is no aim. Rows of
    attacks have `calm`, too: the value without the attack.

    Raises
    ------
    SimulationError
        The service ends, refuses what it should do, does what it should refuse, or does not answer for a
        minute.
    """
    seconds, repeats = settings.seconds, settings.repeats
    alone = [(count, 1) for count in settings.sessions]
    crowds = dict.fromkeys([*alone, *((1, count) for count in settings.viewers)])
    live: dict[str, list[Callable[[Server], Coroutine[None, None, list[Row]]]]] = {
        "intervals": [partial(frame_intervals, crowd=crowd, seconds=seconds) for crowd in crowds],
        "real-time": [partial(real_time, seconds=seconds)],
        "sketch": [partial(sketch, repeats=repeats)],
        "push": [partial(push, repeats=repeats)],
        "hostile": [hostile_uploads],
    }
    if set(settings.part) & set(live):
        with running() as server:
            for name in (name for name in live if name in settings.part):
                for part in live[name]:
                    yield from asyncio.run(part(server))
                on_progress(1)
    rare: dict[str, Callable[[], Iterator[Row]]] = {
        "sockets": lambda: iter(by_sockets(max(settings.sessions), seconds)),
        "restart": lambda: iter(restart(settings.kept, seconds)),
        "door": lambda: door(settings.calls),
        "sizes": lambda: sizes(seconds),
        "visit": lambda: visit(repeats, seconds),
        "attacks": lambda: beside_attacks(seconds),
        "kills": lambda: iter(killed(settings.kills, settings.seed)),
    }
    for name in (name for name in rare if name in settings.part):
        yield from rare[name]()
        on_progress(1)


def door(calls: int) -> Iterator[Row]:
    """Measure what keys and HAProxy add to a call, and to a command of a stream."""
    for name, value, aim in costs(calls):
        yield _row(name, value, "ms", aim)


def visit(repeats: int, seconds: float) -> Iterator[Row]:
    """Measure what visits of the page cost on a fast and on a slow line, and how old its frames are there."""
    for name, value, unit, aim in visits(repeats):
        yield _row(name, value, unit, aim)
    for name, value, unit in ages(seconds):
        yield _row(name, value, unit, None, (1, 2))


def beside_attacks(seconds: float) -> Iterator[Row]:
    """Measure the waits of a bystander beside each attack."""
    for name, attack in ATTACKS.items():
        for measure, value, calm, unit, aim in attacked(attack, seconds):
            row = _row(f"{measure} beside {name}", value, unit, aim, (1, 1))
            yield row | {"calm": significant(calm)}


async def frame_intervals(server: Server, crowd: tuple[int, int], seconds: float) -> list[Row]:
    """Measure the intervals of frames that reach viewers, of water_2d at a quarter of real time.

    `crowd` is the number of sessions, and of viewers of each. The aim is for many of either.
    """
    sessions, viewers = crowd
    async with playing(server.address, _bodies(sessions), viewers=viewers, speed=_SPEED) as watchers:
        await _warm_up(watchers, seconds)
        start, computed = time.perf_counter(), time.process_time()
        await _watch(watchers, seconds)
        load = (time.process_time() - computed) / (time.perf_counter() - start)
        times = _intervals(watchers)
    aim = 40.0 if sessions >= 16 or viewers >= 100 else None
    rows = [
        _row(f"frame interval p{share}", np.percentile(times, share), "ms", limit, crowd)
        for share, limit in ((50, None), (95, None), (99, aim))
    ]
    return [*rows, _row("load of the viewers", load, "cores", None, crowd)]


def by_sockets(sessions: int, seconds: float) -> list[Row]:
    """Measure the intervals of frames as clients see them that only read bytes."""
    with running() as server:
        times = [1e3 * np.diff(ends) for ends in arrivals(server, _bodies(sessions), _SPEED, seconds)]
    values = zip((50, 95, 99), np.percentile(np.concatenate(times), (50, 95, 99)), strict=True)
    crowd = (sessions, 1)
    return [
        _row(f"frame interval by plain sockets p{share}", value, "ms", None, crowd) for share, value in values
    ]


async def real_time(server: Server, seconds: float) -> list[Row]:
    """Measure the time scale of eight sessions of water_2d in the coarse mode 1/16 that aim at 1."""
    bodies = [body | _REAL_TIME for body in _bodies(_REAL_TIME_SESSIONS)]
    async with playing(server.address, bodies, speed=1.0) as watchers:
        await _warm_up(watchers, seconds)
        await _watch(watchers, seconds)
        scales = [viewer.time_scale() for viewer in watchers]
    return [
        _row(f"{name} time scale, coarse 1/16, aim 1", value, "simulated s/s", 1.0, (len(bodies), 1))
        for name, value in (("mean", np.mean(scales)), ("least", np.min(scales)))
    ]


async def sketch(server: Server, repeats: int) -> list[Row]:
    """Measure the time from an arrow to the first frame that it steers, as a viewer sees it.

    The session is water_2d and plays at a quarter of real time; the method is analytic guidance. The first
    sketch of the process, which loads modules, has a row of its own.
    """

    async def act(session: AsyncSession, _viewer: Viewer) -> None:
        await session.steer([[0.4, 0.3], [0.55, 0.45]], kind="arrow", method="analytic")

    first, *later = await _reactions(server, _bodies(1)[0], act, lambda frame: frame.steered, 1 + repeats)
    name = "sketch to the first steered frame"
    return [_row(f"{name}, first sketch", first, "ms"), *_summary(name, later)]


async def push(server: Server, repeats: int) -> list[Row]:
    """Measure the time from a push to the first frame with moved particles, in a fluid at rest."""

    async def act(_session: AsyncSession, viewer: Viewer) -> None:
        await viewer.send("push", point=[0.47, 0.47], velocity=[1.5, 0.5], radius=0.1)

    rest: list[np.ndarray] = []

    def shows(frame: Frame) -> bool:
        if not rest:
            rest.append(frame.positions)
        return not np.array_equal(frame.positions, rest[0])

    return _summary("push to moved particles", await _reactions(server, _RESTING, act, shows, repeats))


async def hostile_uploads(server: Server) -> list[Row]:
    """Measure the slowest and the largest answer to uploads that are made to cost much.

    Raises
    ------
    SimulationError
        The service does not refuse one of them.
    """
    seconds, sizes = [], []
    async with (
        AsyncClient(server.address, timeout=WAIT) as client,
        httpx.AsyncClient(base_url=server.address, timeout=WAIT) as http,
    ):
        session = await client.create(**_bodies(1)[0])
        for one in uploads():
            path = "/v1/sessions" if one.target == "sessions" else f"/v1/sessions/{session.id}/{one.target}"
            body: Row = {"content": one.content, "headers": {"Content-Type": "application/json"}}
            if one.is_picture:
                body = {"files": {"sketch": ("sketch.png", one.content, "image/png")}}
            start = time.perf_counter()
            answer = await http.post(path, **body)
            seconds.append(time.perf_counter() - start)
            sizes.append(len(answer.content) / 1024)
            if not answer.is_client_error:
                raise SimulationError(f"the service answers a hostile upload with {answer.status_code}")
        await session.delete()
    return [
        _row("hostile upload, slowest answer", max(seconds), "s", 1.0, (1, 0)),
        _row("hostile upload, largest answer", max(sizes), "KB", 64.0, (1, 0)),
    ]


def restart(sessions: int, seconds: float) -> list[Row]:
    """Measure the time from a restart after `kill -9` until all sessions answer again.

    The sessions of water_2d are kept on disk, and have played for `seconds` [s] at a quarter of real time
    when the service is killed. The time includes the start of the new process.
    """
    with TemporaryDirectory() as folder:
        flags = ("--state-folder", str(Path(folder) / "state"))
        with running(*flags) as server:
            ids = asyncio.run(_played(server, sessions, seconds))
        start = time.perf_counter()
        with running(*flags) as server:
            asyncio.run(all_answer(server.address, ids))
            took = time.perf_counter() - start
    return [_row("restart after kill -9, until all sessions answer", took, "s", 3.0, (sessions, 0))]


def sizes(seconds: float) -> Iterator[Row]:
    """Measure what sessions take: memory while they pause, and cores while they play.

    A session has computed some frames before its memory is counted. Those that play have a viewer each, and
    play at a quarter of real time for `seconds` [s].
    """

    async def made(server: Server, bodies: Sequence[Row]) -> tuple[float, float]:
        async with AsyncClient(server.address, timeout=WAIT) as client:
            await (await client.create(**bodies[0])).advance(20)
            before, particles = server.memory() or 0, []
            for body in bodies:
                session = await client.create(**body)
                particles.append((await session.advance(20))["particles"])
            memory = (server.memory() or 0) - before
        return memory / len(bodies) / 2**20, float(np.mean(particles))

    async def played(server: Server, bodies: Sequence[Row]) -> float:
        async with playing(server.address, bodies, speed=_SPEED) as watchers:
            await _warm_up(watchers, seconds)
            start, computed = time.perf_counter(), server.computed()
            await _watch(watchers, seconds)
            return (server.computed() - computed) / (time.perf_counter() - start) / len(bodies)

    for scenario in _SIZED:
        bodies = [{"scenario": scenario, "seed": seed} for seed in range(_SIZED_SESSIONS)]
        crowd = (len(bodies), 1)
        with running() as server:
            memory, particles = asyncio.run(made(server, bodies))
        with running() as server:
            cores = asyncio.run(played(server, bodies))
        yield _row(f"particles of a session of {scenario}", particles, "-", None, crowd)
        yield _row(f"memory of a session of {scenario}", memory, "MiB", None, crowd)
        yield _row(f"load of a session of {scenario} at a quarter of real time", cores, "cores", None, crowd)


def killed(count: int, seed: int) -> list[Row]:
    """Kill the service at random moments under load, and compare each session with an uninterrupted run."""
    outcome = kills(count, seed)
    values = {
        "kills under load": (outcome.kills, None),
        "logs compared with uninterrupted runs": (outcome.logs, None),
        "frames of these logs": (outcome.frames, None),
        "inputs of these logs": (outcome.inputs, None),
        "logs whose digests differ": (outcome.differing, 0.0),
        "sessions, frames, inputs and deletions lost": (outcome.lost, 0.0),
    }
    rows = [_row(measure, value, "-", aim, (0, 0)) for measure, (value, aim) in values.items()]
    restarts = {"p50": np.median(outcome.restarts), "worst": max(outcome.restarts)}
    name = "restart after a kill under load, until all sessions answer"
    return [*rows, *(_row(f"{name}, {which}", one, "s", 3.0, (0, 0)) for which, one in restarts.items())]


async def _reactions(
    server: Server,
    body: Row,
    act: Callable[[AsyncSession, Viewer], Awaitable[None]],
    shows: Callable[[Frame], bool],
    repeats: int,
) -> list[float]:
    """Act on a session that plays, and return how long a frame took each time to show it [ms]."""
    pause, times = random.Random(0), []
    async with AsyncClient(server.address, timeout=WAIT) as client:
        session = await client.create(**body)
        async with watching(server.address, session) as viewer:
            for _ in range(repeats):
                calm = viewer.expect(lambda frame: not shows(frame))
                await viewer.send("reset")
                await viewer.send("play")
                await viewer.arrival(calm)
                # At random, so that the player is met in all its phases.
                await asyncio.sleep(pause.uniform(0.0, 0.3))
                shown = viewer.expect(shows)
                start = time.perf_counter()
                await act(session, viewer)
                times.append(1e3 * (await viewer.arrival(shown) - start))
        await session.delete()
    return times


async def _played(server: Server, sessions: int, seconds: float) -> list[str]:
    """Kill a server while its sessions play, and return their ids."""
    async with AsyncClient(server.address, timeout=WAIT) as client, AsyncExitStack() as stack:
        made = [await client.create(**body) for body in _bodies(sessions)]
        for session in made:
            viewer = await stack.enter_async_context(watching(server.address, session))
            await viewer.send("play")
            await viewer.arrival(viewer.expect(lambda _: True))
        await asyncio.sleep(seconds)
        server.process.kill()
    return [session.id for session in made]


async def _warm_up(watchers: Sequence[Viewer], seconds: float) -> None:
    await asyncio.sleep(min(1.0, seconds))
    _forget(watchers)


async def _watch(watchers: Sequence[Viewer], seconds: float) -> None:
    """Wait for some seconds, and longer where a busy machine has not sent two frames to each viewer."""
    await asyncio.sleep(seconds)
    for viewer in watchers:
        while viewer.frames < 2:
            await viewer.arrival(viewer.expect(lambda _frame: True))


def _forget(watchers: Sequence[Viewer]) -> None:
    for viewer in watchers:
        viewer.forget()


def _intervals(watchers: Sequence[Viewer]) -> np.ndarray:
    return np.concatenate([viewer.intervals() for viewer in watchers])


def _bodies(sessions: int) -> list[Row]:
    return [{"scenario": "water_2d", "seed": seed} for seed in range(sessions)]


def _summary(name: str, times: Sequence[float]) -> list[Row]:
    """Return the median and the largest of some times [ms]."""
    return [
        _row(f"{name}, p50", np.percentile(times, 50), "ms"),
        _row(f"{name}, worst", max(times), "ms", 50.0),
    ]


def _row(
    measure: str,
    value: float | np.floating | None,
    unit: str,
    aim: float | None = None,
    crowd: tuple[int, int] = (1, 1),
) -> Row:
    """Return a row; `crowd` is the number of sessions, and of viewers of each."""
    row = {
        "measure": measure,
        "sessions": crowd[0],
        "viewers": crowd[1],
        "value": significant(None if value is None else float(value)),
    }
    return row | {"unit": unit, "aim": aim, "threads": usable_cores()}

"""How soon the service reacts: to a sketch, to a push of a hand, and to an upload made to cost it much."""

import asyncio
import random
import time
from collections.abc import Awaitable, Callable, Sequence

import httpx
import numpy as np

from hybridmpm.errors import SimulationError
from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.service.hostile import Upload, uploads
from hybridmpm_lab.service.server import Server
from hybridmpm_lab.service.viewers import Viewer, answered, client, created, watching

_ARROW = {"strokes": [{"points": [[0.4, 0.3], [0.55, 0.45]], "kind": "arrow"}], "method": "analytic"}
_RESTING: Row = {
    "scene": {
        "name": "resting",
        "dim": 2,
        "gravity": [0.0, 0.0],
        "bodies": [{"shape": "box", "lower": [0.35, 0.35], "upper": [0.6, 0.6], "material": "water"}],
    }
}
"""Water in free space, about as many particles as water_2d has; none moves until something pushes it."""
_PUSH: Row = {"type": "push", "point": [0.47, 0.47], "velocity": [1.5, 0.5], "radius": 0.1}
_HEADER_BYTES = 32
"""Size of what stands before the positions in a frame."""
_FLAGS_OFFSET, _STEERED = 6, 1
"""Place of the flags in a frame, and the flag of one that a sketch steered."""
_LONGEST_PAUSE = 0.3
"""Longest pause before a reaction is asked for [s], drawn at random so that no phase of the player is met."""

Act = Callable[[], Awaitable[None]]


def sketch(server: Server, repeats: int) -> list[Row]:
    """Measure the time from the sending of an arrow to the first frame that it steers, as a viewer sees it.

    The session is water_2d and plays at a quarter of real time; the method is analytic guidance.
    The first sketch of the process, which loads what others find loaded, has a row of its own.
    """

    async def draw() -> list[float]:
        async with client(server.address) as http:
            links = await created(http, {"scenario": "water_2d", "seed": 0})
            async with watching(server.address, links) as viewer:

                async def act() -> None:
                    answered(await http.post(links["sketches"], json=_ARROW))

                times = await _reactions(viewer, act, _is_steered, 1 + repeats)
            answered(await http.delete(links["self"]))
            return times

    first, *later = asyncio.run(draw())
    name = "sketch to the first steered frame"
    return [_row(f"{name}, first sketch", first, None), *_summary(name, later, 50.0)]


def push(server: Server, repeats: int) -> list[Row]:
    """Measure the time from the sending of a push to the first frame in which particles have moved.

    The fluid rests until then, so a frame with any other positions shows the push.
    """

    async def move() -> list[float]:
        async with client(server.address) as http:
            links = await created(http, _RESTING)
            async with watching(server.address, links) as viewer:
                rest = await _resting_positions(viewer)

                async def act() -> None:
                    await viewer.send(**_PUSH)

                times = await _reactions(viewer, act, lambda frame: frame[_HEADER_BYTES:] != rest, repeats)
            answered(await http.delete(links["self"]))
            return times

    return _summary("push to moved particles", asyncio.run(move()), 50.0)


def hostile_uploads(server: Server) -> list[Row]:
    """Measure the slowest and the largest answer to uploads that are made to cost much.

    Raises
    ------
    SimulationError
        The service answers one of them otherwise than by refusing it.
    """

    async def attack() -> tuple[list[float], list[int]]:
        seconds, sizes = [], []
        async with client(server.address) as http:
            links = await created(http, {"scenario": "water_2d", "seed": 0})
            for one in uploads():
                began = time.perf_counter()
                answer = await _sent(http, one, links)
                seconds.append(time.perf_counter() - began)
                sizes.append(len(answer.content))
                if not answer.is_client_error:
                    raise SimulationError(f"the service answers a hostile upload with {answer.status_code}")
            answered(await http.delete(links["self"]))
        return seconds, sizes

    seconds, sizes = asyncio.run(attack())
    return [
        _row("hostile upload, slowest answer", max(seconds), 1.0, unit="s", viewers=0),
        _row("hostile upload, largest answer", max(sizes) / 1024, 64.0, unit="KB", viewers=0),
    ]


async def _reactions(viewer: Viewer, act: Act, shows: Callable[[bytes], bool], repeats: int) -> list[float]:
    """Act on a session that plays, and return how long a frame took each time to show it [ms]."""
    pause, times = random.Random(0), []
    for _ in range(repeats):
        calm = viewer.expect(lambda frame: not shows(frame))
        await viewer.send(type="reset")
        await viewer.send(type="play")
        await viewer.arrival(calm)
        await asyncio.sleep(pause.uniform(0.0, _LONGEST_PAUSE))
        shown = viewer.expect(shows)
        began = time.perf_counter()
        await act()
        times.append(1e3 * (await viewer.arrival(shown) - began))
    return times


async def _resting_positions(viewer: Viewer) -> bytes:
    """Return the positions in the frames of a session at rest."""
    frames: list[bytes] = []

    def keep(frame: bytes) -> bool:
        frames.append(frame)
        return True

    seen = viewer.expect(keep)
    await viewer.send(type="play")
    await viewer.arrival(seen)
    return frames[0][_HEADER_BYTES:]


def _is_steered(frame: bytes) -> bool:
    return bool(frame[_FLAGS_OFFSET] & _STEERED)


async def _sent(http: httpx.AsyncClient, upload: Upload, links: dict[str, str]) -> httpx.Response:
    address = "/v1/sessions" if upload.link == "sessions" else links[upload.link]
    if upload.is_picture:
        return await http.post(address, files={"sketch": ("sketch.png", upload.content, "image/png")})
    return await http.post(address, content=upload.content, headers={"Content-Type": "application/json"})


def _summary(name: str, times: Sequence[float], aim: float) -> list[Row]:
    return [
        _row(f"{name}, p50", float(np.percentile(times, 50)), None),
        _row(f"{name}, worst", max(times), aim),
    ]


def _row(measure: str, value: float, aim: float | None, *, unit: str = "ms", viewers: int = 1) -> Row:
    return {
        "measure": measure,
        "sessions": 1,
        "viewers": viewers,
        "value": significant(value),
        "unit": unit,
        "aim": aim,
    }

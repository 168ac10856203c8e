"""A well-behaved client in a process of its own, whose waiting shows what other clients cost it."""

import asyncio
import multiprocessing
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple

from hybridmpm.client import AsyncClient
from hybridmpm.errors import SimulationError
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.service.viewers import WAIT, playing

_PAUSE = 0.05  # Time between two calls of a kind [s]
_BODY: Row = {"scenario": "water_2d", "seed": 1}


class Wait(NamedTuple):
    """One wait of the bystander."""

    kind: str
    """Call that was answered, "GET" or "POST"; or "frame" for the next one of the stream."""
    start: float
    """Time of `time.perf_counter`, which is the same in all processes [s]."""
    seconds: float


@contextmanager
def standing_by(address: str) -> Iterator[Callable[[], list[Wait]]]:
    """Let a bystander use a server; the function that is yielded ends it, and returns all its waits.

    It looks at `/livez` and at a session, advances another one by a frame, creates and deletes a third one,
    and watches water_2d play at a quarter of real time.

    Raises
    ------
    SimulationError
        One of its calls fails, or takes more than a minute; raised by the function, too.
    """
    ours, theirs = multiprocessing.Pipe()

    def received() -> list[Wait]:
        found = ours.recv() if ours.poll(2 * WAIT) else "it does not answer"
        if isinstance(found, str):
            raise SimulationError(f"the bystander of the service: {found}")
        return list(found)

    def end() -> list[Wait]:
        ours.send("end")
        return received()

    spawn = multiprocessing.get_context("spawn")
    process = spawn.Process(target=_stand_by, args=(address, theirs), daemon=True)
    process.start()
    try:
        received()
        yield end
    finally:
        process.kill()
        process.join()


def _stand_by(address: str, pipe: Any) -> None:
    try:
        pipe.send(asyncio.run(_use(address, pipe)))
    except SimulationError as error:
        pipe.send(str(error))


async def _use(address: str, pipe: Any) -> list[Wait]:
    waits: list[Wait] = []

    async def repeat(kind: str, call: Callable[[], Coroutine[Any, Any, object]]) -> None:
        while not pipe.poll():
            start = time.perf_counter()
            await call()
            waits.append(Wait(kind, start, time.perf_counter() - start))
            await asyncio.sleep(_PAUSE)

    async def create() -> None:
        await (await client.create(**_BODY)).delete()

    async with (
        AsyncClient(address, timeout=WAIT) as client,
        playing(address, [_BODY], speed=0.25) as (viewer,),
    ):
        session = await client.create(**_BODY)
        pipe.send(waits)
        await asyncio.gather(
            repeat("GET", lambda: client.request("GET", "/livez")),
            repeat("GET", session.refresh),
            repeat("POST", session.advance),
            repeat("POST", create),
        )
        frames = [*viewer.arrivals, time.perf_counter()]
    return waits + [Wait("frame", start, end - start) for start, end in pairwise(frames)]

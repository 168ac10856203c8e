"""How soon sessions are there again after the service was killed."""

import asyncio
import time
from contextlib import AsyncExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from hybridmpm.errors import SimulationError
from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.service.server import Server
from hybridmpm_lab.service.viewers import WAIT_SECONDS, answered, client, created, watching

_LOOK_SECONDS = 0.005
"""Time between two looks at a session that is not there yet."""
_AIM = 3.0
"""Longest time until all sessions answer [s]."""
_COMING_BACK = 503
"""Status of the answer for a session that is being computed again."""


def restart(sessions: int, seconds: float) -> list[Row]:
    """Measure the time from a restart after `kill -9` until all sessions answer again.

    Parameters
    ----------
    sessions : int
        Number of sessions of water_2d, kept on disk; they play at a quarter of real time when the service is
        killed.
    seconds : float
        Time for which they have played then [s].

    Returns
    -------
    list of Row
        One row; its time begins before the new process does.
    """
    with TemporaryDirectory() as folder:
        flags = ("--state-folder", str(Path(folder) / "state"))
        with Server(*flags) as server:
            paths = asyncio.run(_played(server, sessions, seconds))
        began = time.perf_counter()
        with Server(*flags) as server:
            asyncio.run(_all_answer(server.address, paths))
            took = time.perf_counter() - began
    return [
        {
            "measure": "restart after kill -9, until all sessions answer",
            "sessions": sessions,
            "viewers": 0,
            "value": significant(took),
            "unit": "s",
            "aim": _AIM,
        }
    ]


async def _played(server: Server, sessions: int, seconds: float) -> list[str]:
    """Kill a server amid the play of its sessions, and return their paths."""
    async with client(server.address) as http, AsyncExitStack() as stack:
        links = [await created(http, {"scenario": "water_2d", "seed": seed}) for seed in range(sessions)]
        for mine in links:
            viewer = await stack.enter_async_context(watching(server.address, mine))
            played = viewer.expect(lambda _frame: True)
            await viewer.send(type="play")
            await viewer.arrival(played)
        await asyncio.sleep(seconds)
        server.kill()
    return [mine["self"] for mine in links]


async def _all_answer(address: str, paths: list[str]) -> None:
    """Wait until every session answers.

    Raises
    ------
    SimulationError
        A session is lost, or does not come back within a minute.
    """
    end = time.perf_counter() + WAIT_SECONDS
    async with client(address) as http:
        for path in paths:
            while (answer := await http.get(path)).status_code == _COMING_BACK:
                if time.perf_counter() > end:
                    raise SimulationError(f"the service has not restored {path} within {WAIT_SECONDS:g} s")
                await asyncio.sleep(_LOOK_SECONDS)
            answered(answer)

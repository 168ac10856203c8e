"""How evenly frames come when many sessions play, many look on, or one of those who look on is slow."""

import asyncio
import time
from collections.abc import Callable, Sequence

import numpy as np

from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.service.server import Server
from hybridmpm_lab.service.slow_client import SlowClient
from hybridmpm_lab.service.viewers import Viewer, playing

_SPEED = 0.25
"""Simulated seconds per second at which frames are watched."""
_LEVEL = "1/16"
"""CoarseLevel of the sessions that play in real time."""
_REAL_TIME_SESSIONS = 8
_MOST_INTERVAL = 40.0
"""Aim for the 99th percentile of frame intervals with many sessions or viewers [ms]."""
_MANY_SESSIONS, _MANY_VIEWERS = 16, 100
_SLOW_SESSIONS = 4
"""Sessions that play while a slow client looks at the first of them."""
_ROUNDS = 2
"""Times that the slow client comes and goes, so that a disturbance of the machine hits both sides."""
_LOOK_SECONDS = 0.05
"""Time between two looks at the memory of the server."""
_MIB = 2**20


def frame_intervals(server: Server, crowd: tuple[int, int], seconds: float) -> list[Row]:
    """Measure the intervals of frames that reach the viewers, of water_2d at a quarter of real time.

    Parameters
    ----------
    server : Server
        The service.
    crowd : (int, int)
        Number of sessions, and of viewers of each.
    seconds : float
        Length of the measurement [s].
    """
    sessions, viewers = crowd

    async def watch() -> tuple[np.ndarray, float]:
        async with playing(server.address, _bodies(sessions), viewers=viewers, speed=_SPEED) as all_viewers:
            await _run_up(all_viewers, seconds)
            began, computed = time.perf_counter(), time.process_time()
            await asyncio.sleep(seconds)
            load = (time.process_time() - computed) / (time.perf_counter() - began)
            return _intervals(all_viewers), load

    times, load = asyncio.run(watch())
    is_judged = sessions >= _MANY_SESSIONS or viewers >= _MANY_VIEWERS
    here = {"sessions": sessions, "viewers": viewers}
    rows = [
        {
            "measure": f"frame interval p{share}",
            **here,
            "value": significant(float(np.percentile(times, share))),
            "unit": "ms",
            "aim": _MOST_INTERVAL if is_judged and share == 99 else None,
        }
        for share in (50, 95, 99)
    ]
    told = {"measure": "load of the viewers", **here, "value": significant(load), "unit": "cores"}
    return [*rows, told | {"aim": None}]


def real_time(server: Server, seconds: float) -> list[Row]:
    """Measure the time scale that eight sessions of water_2d on coarse level 1/16 reach, when asked for 1."""
    bodies = [body | {"coarse": _LEVEL} for body in _bodies(_REAL_TIME_SESSIONS)]

    async def watch() -> list[float]:
        async with playing(server.address, bodies, speed=1.0) as crowd:
            await _run_up(crowd, seconds)
            await asyncio.sleep(seconds)
            return [viewer.time_scale() for viewer in crowd]

    scales = asyncio.run(watch())
    return [
        {
            "measure": f"{name} time scale, asked for 1, coarse level {_LEVEL}",
            "sessions": len(bodies),
            "viewers": 1,
            "value": significant(value),
            "unit": "simulated s/s",
            "aim": 1.0,
        }
        for name, value in (("mean", float(np.mean(scales))), ("least", min(scales)))
    ]


def slow_client(server: Server, seconds: float) -> list[Row]:
    """Measure what a client at 1 KB/s costs: the others' frame intervals, and the memory that it holds.

    Four sessions of water_2d play at a quarter of real time, each with a viewer that keeps up. The slow
    client looks at the first of them for `seconds` [s], stays away for as long, and so on. It connects
    anew every six seconds, since the server drops it after five.

    The memory is the most that the process grows above what it had before the client came, and what the
    system keeps of frames for the client besides. Whatever else makes the process grow meanwhile counts, too.
    """

    async def watch() -> tuple[np.ndarray, np.ndarray, int | None]:
        without, beside, held = [], [], []
        async with playing(server.address, _bodies(_SLOW_SESSIONS), speed=_SPEED) as crowd:
            await _run_up(crowd, seconds)
            for _ in range(_ROUNDS):
                before = await _most(server.memory, seconds)
                without.append(_intervals(crowd))
                async with SlowClient(server.address, crowd[0].path) as slow:
                    _begin(crowd)
                    most = await _most(lambda: _memory_with(server, slow.port), seconds)
                    beside.append(_intervals(crowd))
                if before is not None and most is not None:
                    held.append(most - before)
                _begin(crowd)
        return np.concatenate(without), np.concatenate(beside), max(held, default=None)

    without, beside, held = asyncio.run(watch())
    p99 = [float(np.percentile(times, 99)) for times in (without, beside)]
    figures = (
        ("frame interval p99 without a client at 1 KB/s", p99[0], "ms", None),
        ("frame interval p99 beside a client at 1 KB/s", p99[1], "ms", None),
        ("frame interval p99 beside a client at 1 KB/s, over without", p99[1] / p99[0], "-", 1.05),
        ("memory held for a client at 1 KB/s", None if held is None else held / _MIB, "MiB", 2.0),
    )
    return [
        {
            "measure": measure,
            "sessions": _SLOW_SESSIONS,
            "viewers": 1,
            "value": significant(value),
            "unit": unit,
            "aim": aim,
        }
        for measure, value, unit, aim in figures
    ]


def _bodies(sessions: int) -> list[Row]:
    return [{"scenario": "water_2d", "seed": seed} for seed in range(sessions)]


async def _run_up(crowd: Sequence[Viewer], seconds: float) -> None:
    """Let all sessions have come into their stride."""
    for viewer in crowd:
        await viewer.arrival(viewer.expect(lambda _frame: True))
    await asyncio.sleep(min(1.0, seconds))
    _begin(crowd)


def _begin(crowd: Sequence[Viewer]) -> None:
    for viewer in crowd:
        viewer.begin()


def _intervals(crowd: Sequence[Viewer]) -> np.ndarray:
    return np.concatenate([viewer.intervals() for viewer in crowd])


def _memory_with(server: Server, port: int) -> int | None:
    memory = server.memory()
    return None if memory is None else memory + (server.queued(port) if port else 0)


async def _most(memory: Callable[[], int | None], seconds: float) -> int | None:
    """Return the largest of what is measured for so long [bytes]."""
    end, most = time.perf_counter() + seconds, memory()
    while most is not None and time.perf_counter() < end:
        await asyncio.sleep(min(_LOOK_SECONDS, seconds))
        most = max(most, memory() or 0)
    await asyncio.sleep(max(0.0, end - time.perf_counter()))
    return most

"""Speed of the radius graph from small sizes to a million points, beside SciPy's k-d tree."""

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import radius_graph
from hybridmpm.errors import SimulationError
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.settings import setting
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns
from hybridmpm_lab.speed.baselines import SEARCHES

MAX_BASELINE_PARTICLES = 100_000
"""Number of points above which the baseline is not measured."""
REACH = {2: 2.5, 3: 2.0}
"""Radius in mean distances of points: about 18 neighbours in 2D and 28 in 3D, fewer at walls."""


@dataclass(frozen=True, kw_only=True)
class GraphSettings:
    """Sizes and length of the measurement."""

    particles: tuple[int, ...] = setting(
        (4000, 20_000, 100_000, 300_000, 1_000_000), "Number of points of a cloud.", low=64, high=10_000_000
    )
    threads: tuple[int, ...] = setting((1, 2), "Number of threads of our search.", low=1, high=1024)
    baseline: tuple[str, ...] = setting((), "Search to be timed by turns with ours.", SEARCHES)
    repeats: int = setting(9, "Number of timings, the least of which counts.", low=1, high=1000)

    @property
    def steps(self) -> int:
        """Number of rows."""
        return 2 * len(self.particles) * len(self.threads)


def measure(settings: GraphSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure 2D and 3D clouds of each size and yield a row for each number of threads.

    `ms` is the time of a fresh graph from positions, `ms_reused` that of a graph into the arrays and memory
    of the last. The baseline's time includes building its tree. `on_progress` counts rows.

    Raises
    ------
    SimulationError
        The baseline found other edges: its speed would mean nothing.
    """
    for count in settings.particles:
        for dim in (2, 3):
            beside = settings.baseline[:1] if count <= MAX_BASELINE_PARTICLES else ()
            yield from _measured(*cloud(dim, count), settings, *beside)
            on_progress(len(settings.threads))


def cloud(dim: int, particles: int) -> tuple[npt.NDArray[np.float32], float]:
    """Return a cloud of points in the unit box, and the radius of its graph.

    The points are those of a jittered lattice, about `particles` many, in random order: after some seconds
    the order of a simulation's particles is random, too.
    """
    per_axis = round(particles ** (1 / dim))
    rng = np.random.default_rng(particles)
    sites = np.stack(np.meshgrid(*[np.arange(per_axis)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    x = rng.permutation((sites + rng.uniform(0.1, 0.9, sites.shape)) / per_axis)
    return x.astype(np.float32), float(np.float32(REACH[dim] / per_axis))


def _measured(
    x: npt.NDArray[np.float32], radius: float, settings: GraphSettings, baseline: str | None = None
) -> Iterator[Row]:
    graph, name = radius_graph(x, radius), None
    calls: list[Callable[[], Any]] = []
    for count in settings.threads:
        kept = radius_graph(x, radius, threads=count)
        calls += [
            partial(radius_graph, x, radius, threads=count),
            partial(radius_graph, x, radius, threads=count, out=kept),
        ]
    if baseline:
        package, spatial = importlib.import_module(baseline), importlib.import_module(f"{baseline}.spatial")
        name = f"{baseline} {package.__version__}"
        calls.append(lambda: spatial.cKDTree(x).query_pairs(radius, output_type="ndarray"))
        require_same_edges(graph.receivers, graph.senders, calls[-1]())
    times = seconds_by_turns([TimedCall(call=call) for call in calls], settings.repeats)
    ms = [round(1e3 * min(mine), 4) for mine in times]
    theirs = ms[-1] if baseline else None
    for k, count in enumerate(settings.threads):
        yield {
            "dim": x.shape[1],
            "particles": len(x),
            "radius": round(radius, 6),
            "edges": len(graph.senders),
            "threads": count,
            "ms": ms[2 * k],
            "ms_reused": ms[2 * k + 1],
            "peer": name,
            "peer_ms": theirs,
            "ratio": theirs and round(theirs / ms[2 * k], 2),
        }


def require_same_edges(
    receivers: npt.NDArray[np.uint32], senders: npt.NDArray[np.uint32], pairs: npt.NDArray[np.intp]
) -> None:
    """Raise a `SimulationError` unless the edges of a graph are the pairs (E / 2, 2) of a baseline."""
    once = receivers < senders
    mine = np.stack([receivers[once], senders[once]], axis=1)
    theirs = np.sort(pairs, axis=1)
    theirs = theirs[np.lexsort((theirs[:, 1], theirs[:, 0]))]
    if not np.array_equal(mine, theirs):
        raise SimulationError(
            f"the baseline found {len(theirs)} pairs that are not our {len(mine)}, so its speed means nothing"
        )

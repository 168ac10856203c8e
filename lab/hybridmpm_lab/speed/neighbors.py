"""Speed of the radius graph, beside SciPy's k-d tree and from small sizes to a million points."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt

from hybridmpm._core import radius_graph
from hybridmpm._support import charts
from hybridmpm.errors import SimulationError
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedCall, seconds_by_turns
from hybridmpm_lab.speed.baselines.loading import peer_module
from hybridmpm_lab.speed.size_chart import draw_over_particles

MAX_PARTICLES = 10_000_000
"""Largest number of points that a cloud may be asked to have."""
MAX_PEER_PARTICLES = 100_000
"""Number of points above which the peer is not measured."""
PEER = "scipy"
"""The peer that the radius graph can be measured beside."""

REACH = {2: 2.5, 3: 2.0}
"""Radius in mean distances of points: about 18 neighbours in 2D and 28 in 3D, fewer at walls."""


@dataclass(frozen=True, kw_only=True)
class NeighborsSettings:
    """Sizes and length of the measurement."""

    particles: tuple[int, ...] = (4000, 20_000, 100_000, 300_000, 1_000_000)
    """Numbers of points of a jittered lattice that are aimed at."""
    threads: tuple[int, ...] = (1, 2)
    """Numbers of threads of our search; each has its row."""
    repeats: int = 9
    """Number of timings, the least of which is reported: a busy machine only adds to it."""
    peer: str | None = None
    """Peer to be measured by turns with ours up to `MAX_PEER_PARTICLES`; it has one thread."""

    @property
    def count(self) -> int:
        """Number of rows."""
        return 2 * len(self.particles) * len(self.threads)


def measure(settings: NeighborsSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure 2D and 3D clouds of each size and yield a row for each number of threads.

    `ms` is the time of a fresh graph from positions, `ms_reused` that of a graph into the arrays and memory
    of the last. The peer's time includes building its tree. `on_progress` counts rows.

    Raises
    ------
    ConfigError
        The peer is unknown or not installed.
    SimulationError
        The peer found other edges: its speed would mean nothing.
    """
    peer = None if settings.peer is None else peer_module(settings.peer, known=(PEER,))
    for particles in settings.particles:
        for dim in (2, 3):
            for row in _case(dim, particles, settings, peer):
                yield row
                on_progress(1)


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


def _case(dim: int, particles: int, settings: NeighborsSettings, peer: ModuleType | None) -> Iterator[Row]:
    x, radius = cloud(dim, particles)
    graph = radius_graph(x, radius)
    compared = peer if particles <= MAX_PEER_PARTICLES else None
    calls: list[Callable[[], object]] = []
    for threads in settings.threads:
        calls += _ours(x, radius, threads)
    if compared is not None:
        _require_same_edges(graph.receivers, graph.senders, compared.pairs(x, radius))
        calls.append(partial(compared.pairs, x, radius))
    times = seconds_by_turns([TimedCall(call=call) for call in calls], settings.repeats)
    ms = [1e3 * min(mine) for mine in times]
    theirs = ms[-1] if compared is not None else None
    for index, threads in enumerate(settings.threads):
        fresh, reused = ms[2 * index : 2 * index + 2]
        yield {
            "dim": dim,
            "particles": len(x),
            "radius": round(radius, 6),
            "edges": len(graph.senders),
            "threads": threads,
            "ms": round(fresh, 4),
            "ms_reused": round(reused, 4),
            "peer": compared.NAME if compared is not None else None,
            "peer_ms": None if theirs is None else round(theirs, 4),
            "ratio": None if theirs is None else round(theirs / fresh, 2),
        }


def _ours(x: npt.NDArray[np.float32], radius: float, threads: int) -> list[Callable[[], object]]:
    """Return two calls: for a fresh graph, and for one that reuses memory."""
    kept = radius_graph(x, radius, threads=threads)
    return [
        partial(radius_graph, x, radius, threads=threads),
        partial(radius_graph, x, radius, threads=threads, out=kept),
    ]


def _require_same_edges(
    receivers: npt.NDArray[np.uint32], senders: npt.NDArray[np.uint32], pairs: npt.NDArray[np.intp]
) -> None:
    once = receivers < senders
    mine = np.stack([receivers[once], senders[once]], axis=1)
    theirs = np.sort(pairs, axis=1)
    theirs = theirs[np.lexsort((theirs[:, 1], theirs[:, 0]))]
    if not np.array_equal(mine, theirs):
        raise SimulationError(
            f"the peer found {len(theirs)} pairs that are not our {len(mine)}; its speed would mean nothing"
        )


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw the time of a graph against its points, ours by threads and the peer's, as SVG and PNG.

    Raises as `charts.panels` and `charts.save`.
    """
    figure, axes = charts.panels(columns=2)
    for panel, dim in zip(axes[0], (2, 3), strict=True):
        mine = [row for row in rows if row["dim"] == dim]
        has_peer = any(row["peer"] for row in mine)
        draw_over_particles(panel, mine, "ms", ("SciPy cKDTree", "peer_ms") if has_peer else None)
        neighbors = sum(row["edges"] for row in mine) / sum(row["particles"] for row in mine)
        panel.set(title=f"{dim}D, {neighbors:.0f} neighbours", xscale="log", yscale="log")
        panel.set(xlabel="particles", ylabel="ms per graph")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    charts.save(figure, file)

"""Speed of the radius graph, beside SciPy's k-d tree and from small sizes to a million points."""

import dataclasses
import importlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from hybridmpm._native import VerletList, radius_graph
from hybridmpm._support import charts
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.errors import ConfigError, SimulationError

if TYPE_CHECKING:
    from types import ModuleType

MAX_PARTICLES = 10_000_000
MAX_PEER_PARTICLES = 100_000
"""Above this only ours is measured."""

REACH = {2: 2.5, 3: 2.0}
"""Radius in mean distances of particles: about 18 neighbours in 2D and 28 in 3D, walls apart."""
SKIN = 0.2
"""Of the Verlet list, in radii; particles then move by a twentieth of the radius."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Sizes and length of the measurement."""

    particles: tuple[int, ...] = (4000, 20_000, 100_000, 300_000, 1_000_000)
    """Of a jittered lattice, about."""
    threads: tuple[int, ...] = (1, 2)
    """Of ours; each has its row."""
    repeats: int = 9
    """The least time over these is reported: what a busy machine adds is nobody's."""
    peer: str | None = None
    """"scipy", to be measured by turns with ours up to `MAX_PEER_PARTICLES`; it has one thread."""


def rows(settings: Settings, source: Provenance) -> Iterator[dict[str, Any]]:
    """Measure 2D and 3D clouds of each size and yield a row for each number of threads.

    `ms` is a fresh graph from positions, `ms_reused` one into the arrays and memory of the last,
    `ms_verlet` one from the candidates of a Verlet list that hold. The peer's time holds building its tree.

    Raises
    ------
    ConfigError
        The peer is unknown or not installed.
    SimulationError
        The peer found other edges, so that its speed would mean nothing.
    """
    peer = None if settings.peer is None else peer_module(settings.peer)
    for particles in settings.particles:
        for dim in (2, 3):
            for row in _case(dim, particles, settings, peer):
                yield {**row, **dataclasses.asdict(source)}


def peer_module(name: str) -> "ModuleType":
    """Import the module of a peer.

    Raises
    ------
    ConfigError
        There is no such peer, or what it needs is not installed.
    """
    if name != "scipy":
        raise ConfigError(f"the peer must be scipy, got {name!r}")
    try:
        return importlib.import_module("hybridmpm.bench.peers.scipy_tree")
    except ImportError:
        raise ConfigError("the peer scipy is not installed: pip install 'hybridmpm[bench]'") from None


def cloud(dim: int, particles: int) -> tuple[npt.NDArray[np.float32], float]:
    """Return about `particles` points of a jittered lattice in the unit box, in random order, and the radius.

    The order is random because that of a simulation is, too, after some seconds.
    """
    per_axis = round(particles ** (1 / dim))
    rng = np.random.default_rng(particles)
    sites = np.stack(np.meshgrid(*[np.arange(per_axis)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    x = rng.permutation((sites + rng.uniform(0.1, 0.9, sites.shape)) / per_axis)
    return x.astype(np.float32), float(np.float32(REACH[dim] / per_axis))


def _case(
    dim: int, particles: int, settings: Settings, peer: "ModuleType | None"
) -> Iterator[dict[str, Any]]:
    x, radius = cloud(dim, particles)
    graph = radius_graph(x, radius)
    compared = peer if particles <= MAX_PEER_PARTICLES else None
    calls: list[Callable[[], object]] = []
    for threads in settings.threads:
        calls += _ours(x, radius, threads)
    if compared is not None:
        _require_same_edges(graph.receivers, graph.senders, compared.pairs(x, radius))
        calls.append(partial(compared.pairs, x, radius))
    ms = [1e3 * seconds for seconds in _least_seconds(calls, settings.repeats)]
    theirs = ms[-1] if compared is not None else None
    for index, threads in enumerate(settings.threads):
        fresh, reused, verlet = ms[3 * index : 3 * index + 3]
        yield {
            "dim": dim,
            "particles": len(x),
            "radius": round(radius, 6),
            "edges": len(graph.senders),
            "threads": threads,
            "ms": round(fresh, 4),
            "ms_reused": round(reused, 4),
            "ms_verlet": round(verlet, 4),
            "peer": compared.NAME if compared is not None else None,
            "peer_ms": None if theirs is None else round(theirs, 4),
            "ratio": None if theirs is None else round(theirs / fresh, 2),
        }


def _ours(x: npt.NDArray[np.float32], radius: float, threads: int) -> list[Callable[[], object]]:
    """Return calls for a fresh graph, one that reuses memory, and one from a Verlet list."""
    neighbors = VerletList(radius, SKIN * radius, threads=threads)
    kept, listed = radius_graph(x, radius, threads=threads), neighbors.graph(x)
    moved = x + np.float32(0.05 * radius)
    return [
        partial(radius_graph, x, radius, threads=threads),
        partial(radius_graph, x, radius, threads=threads, out=kept),
        partial(neighbors.graph, moved, out=listed),
    ]


def _least_seconds(calls: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Call them by turns, so that what disturbs the machine disturbs all."""
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats + 1):
        for call, mine in zip(calls, times, strict=True):
            began = time.perf_counter()
            call()
            mine.append(time.perf_counter() - began)
    # The first round warms the caches up.
    return [min(mine[1:]) for mine in times]


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


def chart(rows: Sequence[dict[str, Any]], file: Path) -> None:
    """Draw the time of a graph against its points, ours by threads and the peer, as SVG and PNG.

    Raises
    ------
    ConfigError
        matplotlib is not installed.
    ExportError
        A file could not be written.
    """
    figure, axes = charts.panels(columns=2)
    threads = sorted({row["threads"] for row in rows})
    for panel, dim in zip(axes[0], (2, 3), strict=True):
        mine = [row for row in rows if row["dim"] == dim]
        lines = [(_label(count), "ms", count) for count in threads]
        if any(row["peer"] for row in mine):
            lines.append(("SciPy cKDTree", "peer_ms", threads[0]))
        for (label, field, count), marker in zip(lines, charts.MARKERS, strict=False):
            points = sorted(
                (row["particles"], row[field])
                for row in mine
                if row["threads"] == count and row[field] is not None
            )
            panel.plot(*zip(*points, strict=True), marker=marker, label=label)
        neighbors = sum(row["edges"] for row in mine) / sum(row["particles"] for row in mine)
        panel.set(title=f"{dim}D, {neighbors:.0f} neighbours", xscale="log", yscale="log")
        panel.set(xlabel="particles", ylabel="ms per graph")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(lines))
    charts.save(figure, file)


def _label(threads: int) -> str:
    return f"hybridmpm, {threads} thread{'' if threads == 1 else 's'}"

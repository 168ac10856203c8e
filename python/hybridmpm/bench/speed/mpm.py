"""Speed of the solver: a block in the middle of its splash, at the ground truth's substeps."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridmpm._support import charts
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.bench.report.timing import Timed, seconds_per_frame
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene

if TYPE_CHECKING:
    from types import ModuleType

CASES: tuple[tuple[int, str], ...] = ((2, "water"), (2, "sand"), (3, "water"), (3, "sand"))
"""(dimension, material) of each row."""
MAX_PARTICLES = 1_000_000

_WALL_LOW, _WALL_HIGH = 0.1, 0.9
_PEER_FIELDS = (
    "peer", "peer_ns", "peer_threads", "peer_ns_serial", "peer_ns_serial_scatter", "peer_ns_atomic",
)  # fmt: skip
_RUN_UP = 120
"""Frames before the measurement: the block has hit the floor by then and is spreading."""
_LARGEST_SHARE = 0.5
"""Of the box, in 2D as 20 000 particles take it at 128^2; larger blocks get a finer grid."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Size and length of the measurement."""

    particles: tuple[int, ...] = (2300, 4000, 20_000, 100_000)
    """Aimed at; a row tells how many there were."""
    threads: tuple[int, ...] = (1, 2)
    """Of our solver; each has its row."""
    repeats: int = 9
    """The median over these is reported."""
    peer: str | None = None
    """"taichi", to be measured by turns with ours; the best of its settings on one and two threads counts."""


def rows(settings: Settings, source: Provenance) -> Iterator[dict[str, Any]]:
    """Measure each of `CASES` and yield its rows; the peer's fields are null without a peer.

    The peer starts from our state in mid-splash, sand from its volume alone, and takes as many substeps.
    Its water does without our correction of the volume, its walls act on whole nodes.

    Raises
    ------
    ConfigError
        The peer is unknown or not installed.
    SimulationError
        The state before the measurement is not sane, or the peer's afterwards not ours, so that a speed would
        mean nothing.
    """
    peer = None if settings.peer is None else peer_module(settings.peer)
    for particles in settings.particles:
        for dim, material in CASES:
            for row in _case(falling_block(dim, material, particles), settings, peer):
                yield {"dim": dim, "material": material, **row, **dataclasses.asdict(source)}


def peer_module(name: str) -> "ModuleType":
    """Import the module of a peer.

    Raises
    ------
    ConfigError
        There is no such peer, or what it needs is not installed.
    """
    if name != "taichi":
        raise ConfigError(f"the peer must be taichi, got {name!r}")
    try:
        from hybridmpm.bench.peers import taichi_mpm  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("the peer taichi is not installed: pip install 'hybridmpm[bench]'") from None
    return taichi_mpm


def _case(scene: Scene, settings: Settings, peer: "ModuleType | None") -> Iterator[dict[str, Any]]:
    solvers = [MpmSolver(scene, substeps="reference", threads=threads) for threads in settings.threads]
    first = solvers[0]
    first.advance(_RUN_UP)
    _require_sane(first)
    start, count = first.snapshot(), first.particle_count
    substeps = first.last_frame.substeps if first.last_frame else 0
    frames = min(20, math.ceil(200_000 / count))
    timed = [Timed(restore=partial(s.restore, start), advance=s.advance, frames=frames) for s in solvers]
    peers = [] if peer is None else _peers(peer, scene, substeps)
    state = (first.positions, first.velocities, first.affine, first.volume_ratio)
    timed += [Timed(restore=partial(p.load, *state), advance=p.advance, frames=frames) for p in peers]
    seconds = seconds_per_frame(timed, settings.repeats)
    _require_agreement(first, peers)
    ns = [s * 1e9 / (count * substeps) for s in seconds]
    theirs = ns[len(solvers) :]
    for threads, mine, per_frame in zip(settings.threads, ns, seconds, strict=False):
        yield {
            "particles": count,
            "resolution": scene.resolution,
            "threads": threads,
            "substeps": substeps,
            "ns_per_particle_substep": round(mine, 2),
            "ms_per_frame": round(per_frame * 1e3, 4),
            **_compared(peer, theirs),
            "ratio": None if peer is None else round(min(theirs) / mine, 2),
        }


def _peers(peer: "ModuleType", scene: Scene, substeps: int) -> list[Any]:
    peer.start()
    return [peer.TaichiMpm(scene, substeps=substeps, setting=setting) for setting in peer.SETTINGS]


def _require_agreement(solver: MpmSolver, peers: Sequence[Any]) -> None:
    """Raise unless most particles ended where ours did; those near walls need not, nor those of the spray."""
    for peer in peers:
        apart = np.median(np.linalg.norm(peer.positions - solver.positions, axis=1))
        if not apart < solver.scene.dx / 2:
            raise SimulationError(
                f"{solver.scene.name}: half of the peer's particles ended {apart:.2g} m or more from ours, "
                f"allowed is half a cell, {solver.scene.dx / 2:.2g} m; their speed would mean nothing"
            )


def _compared(peer: "ModuleType | None", ns: Sequence[float]) -> dict[str, Any]:
    if peer is None:
        return dict.fromkeys(_PEER_FIELDS)
    best = min(ns)
    each = {f"peer_ns_{name}": round(value, 2) for name, value in zip(peer.SETTINGS, ns, strict=True)}
    threads = list(peer.SETTINGS.values())[ns.index(best)]
    return {"peer": peer.NAME, "peer_ns": round(best, 2), "peer_threads": threads, **each}


def falling_block(dim: int, material: str, particles: int) -> Scene:
    """Scene with one block of at most `particles` particles that falls aslant.

    The grid is 128^2 or 64^3, or as fine as it takes that the block fills at most half of the box.
    """
    resolution = _resolution(dim, particles)
    spacing = 0.5 / resolution  # 2**D particles per cell
    sides = [spacing * count for count in _counts(particles, dim)]
    middle = (_WALL_LOW + _WALL_HIGH) / 2
    # On the lattice of the sampler, so that the count is exact.
    lower = [spacing * round((middle - side / 2) / spacing) for side in sides]
    return Scene(
        name=f"falling block of {material}",
        dim=dim,
        resolution=resolution,
        bodies=(
            Box(
                material=material,
                lower=tuple(lower),
                upper=tuple(a + side for a, side in zip(lower, sides, strict=True)),
                velocity=(1.0, -2.0, 0.5)[:dim],
            ),
        ),
        max_particles=2 * MAX_PARTICLES,
    )


def _resolution(dim: int, particles: int) -> int:
    per_axis = math.pow(particles / _LARGEST_SHARE, 1 / dim) / 2  # cells, at 2**D particles each
    fine_enough: int = 32 * math.ceil(per_axis / (_WALL_HIGH - _WALL_LOW) / 32)
    return max(fine_enough, 128 if dim == 2 else 64)


def _counts(particles: int, dim: int) -> list[int]:
    """Sites along each axis, about equally many, whose product is `particles` or somewhat less."""
    if dim == 1:
        return [particles]
    even = max(1, math.floor(particles ** (1.0 / dim) + 1e-9))
    exact = [count for count in range(even, even // 2, -1) if particles % count == 0]
    count = exact[0] if exact else even
    return [count, *_counts(particles // count, dim - 1)]


def _require_sane(solver: MpmSolver) -> None:
    x, v = solver.positions, solver.velocities
    inside = ((x > _WALL_LOW - solver.scene.dx) & (x < _WALL_HIGH + solver.scene.dx)).all()
    if not (inside and np.isfinite(v).all() and 0.05 < np.abs(v).max() < 50):
        raise SimulationError(f"{solver.scene.name}: the state after {solver.frame} frames is not a splash")


def chart(rows: Sequence[dict[str, Any]], file: Path) -> None:
    """Draw time per particle-substep against particles, ours by threads and the peer, as SVG and PNG.

    Raises
    ------
    ConfigError
        matplotlib is not installed.
    ExportError
        A file could not be written.
    """
    cases = list(dict.fromkeys((row["dim"], row["material"]) for row in rows))
    figure, axes = charts.panels(columns=2, rows=len(cases) // 2)
    for panel, (dim, material) in zip(axes.flat, cases, strict=True):
        mine = [row for row in rows if (row["dim"], row["material"]) == (dim, material)]
        lines = [
            (f"hybridmpm, {_plural(threads)}", "ns_per_particle_substep", threads)
            for threads in sorted({row["threads"] for row in mine})
        ]
        if mine[0]["peer"]:
            label = f"{mine[0]['peer'].capitalize()}, best of 1 and 2 threads"
            lines.append((label, "peer_ns", mine[0]["threads"]))
        for (label, field, threads), marker in zip(lines, charts.MARKERS, strict=False):
            points = sorted((row["particles"], row[field]) for row in mine if row["threads"] == threads)
            panel.plot(*zip(*points, strict=True), marker=marker, label=label)
        panel.set(title=f"{material} {dim}D", xscale="log", ylim=(0, 1.1 * panel.dataLim.y1))
        panel.set(xlabel="particles", ylabel="ns per particle and substep")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    charts.save(figure, file)


def _plural(threads: int) -> str:
    return f"{threads} thread{'' if threads == 1 else 's'}"

"""Speed of the solver: a block in the middle of its splash, at the ground truth's substeps."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from hybridmpm._support import charts
from hybridmpm.bench.peers.loading import peer_module
from hybridmpm.bench.report.rows import Progress, Row
from hybridmpm.bench.report.timing import TimedSimulation, seconds_per_frame
from hybridmpm.bench.speed.size_chart import draw_over_particles
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene

CASES: tuple[tuple[int, str], ...] = ((2, "water"), (2, "sand"), (3, "water"), (3, "sand"))
"""Dimension and material of each row."""
MAX_PARTICLES = 1_000_000
"""Largest number of particles that a block may be asked to have."""
PEER = "taichi"
"""The peer that the solver can be measured beside."""

_WALL_LOW, _WALL_HIGH = 0.1, 0.9
_PEER_FIELDS = (
    "peer", "peer_ns", "peer_threads", "peer_ns_serial", "peer_ns_serial_scatter", "peer_ns_atomic",
)  # fmt: skip
_RUN_UP = 120
"""Frames before the measurement: the block has hit the floor by then and is spreading."""
_LARGEST_SHARE = 0.5
"""Largest part of the box that a block fills; 20 000 particles at 128^2 fill it, more get a finer grid."""


@dataclass(frozen=True, kw_only=True)
class MpmSettings:
    """Size and length of the measurement."""

    particles: tuple[int, ...] = (2300, 4000, 20_000, 100_000)
    """Numbers of particles aimed at; a row tells how many there were."""
    threads: tuple[int, ...] = (1, 2)
    """Numbers of threads of our solver; each has its row."""
    repeats: int = 9
    """Number of timings, whose median is reported."""
    peer: str | None = None
    """Peer to be measured by turns with ours; the best of its settings on one and two threads counts."""

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(CASES) * len(self.particles) * len(self.threads)


def measure(settings: MpmSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure each of `CASES` and yield its rows, which `on_progress` counts.

    The peer starts from our state in mid-splash and takes as many substeps; its sand starts from the volume
    alone. Its water does without our correction of the volume, and its walls act on whole nodes. Fields of
    the peer are None without a peer.

    Raises
    ------
    ConfigError
        The peer is unknown or not installed.
    SimulationError
        The state before the measurement is not a splash, or the peer's state afterwards is not ours: a speed
        would mean nothing.
    """
    peer = None if settings.peer is None else peer_module(settings.peer, known=PEER)
    for particles in settings.particles:
        for dim, material in CASES:
            for row in _case(falling_block(dim, material, particles), settings, peer):
                yield {"dim": dim, "material": material, **row}
                on_progress(1)


def _case(scene: Scene, settings: MpmSettings, peer: ModuleType | None) -> Iterator[Row]:
    solvers = [MpmSolver(scene, substeps="reference", threads=threads) for threads in settings.threads]
    first = solvers[0]
    first.advance(_RUN_UP)
    _require_sane(first)
    start, count = first.snapshot(), first.particle_count
    substeps = first.last_frame.substeps if first.last_frame else 0
    frames = min(20, math.ceil(200_000 / count))
    timed = [
        TimedSimulation(restore=partial(s.restore, start), advance=s.advance, frames=frames) for s in solvers
    ]
    peers = [] if peer is None else _peers(peer, scene, substeps)
    state = (first.positions, first.velocities, first.affine, first.volume_ratio)
    timed += [
        TimedSimulation(restore=partial(p.load, *state), advance=p.advance, frames=frames) for p in peers
    ]
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


def _peers(peer: ModuleType, scene: Scene, substeps: int) -> list[Any]:
    peer.start()
    return [peer.TaichiMpm(scene, substeps=substeps, setting=setting) for setting in peer.SETTINGS]


def _require_agreement(solver: MpmSolver, peers: Sequence[Any]) -> None:
    """Raise unless half of a peer's particles ended near ours; those near walls and in the spray need not."""
    for peer in peers:
        apart = np.median(np.linalg.norm(peer.positions - solver.positions, axis=1))
        if not apart < solver.scene.dx / 2:
            raise SimulationError(
                f"{solver.scene.name}: half of the peer's particles ended {apart:.2g} m or more from ours, "
                f"allowed is half a cell, {solver.scene.dx / 2:.2g} m; their speed would mean nothing"
            )


def _compared(peer: ModuleType | None, ns: Sequence[float]) -> dict[str, Any]:
    if peer is None:
        return dict.fromkeys(_PEER_FIELDS)
    best = min(ns)
    each = {f"peer_ns_{name}": round(value, 2) for name, value in zip(peer.SETTINGS, ns, strict=True)}
    threads = list(peer.SETTINGS.values())[ns.index(best)]
    return {"peer": peer.NAME, "peer_ns": round(best, 2), "peer_threads": threads, **each}


def falling_block(dim: int, material: str, particles: int) -> Scene:
    """Return a scene with one block of at most `particles` particles that falls aslant.

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
    """Return numbers of sites along each axis, about equal, whose product is `particles` or somewhat less."""
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


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw time per particle-substep against particles, ours by threads and the peer's, as SVG and PNG.

    Raises as `charts.panels` and `charts.save`.
    """
    cases = list(dict.fromkeys((row["dim"], row["material"]) for row in rows))
    figure, axes = charts.panels(columns=2, rows=len(cases) // 2)
    for panel, (dim, material) in zip(axes.flat, cases, strict=True):
        mine = [row for row in rows if (row["dim"], row["material"]) == (dim, material)]
        peer = mine[0]["peer"] and (f"{mine[0]['peer'].capitalize()}, best of 1 and 2 threads", "peer_ns")
        draw_over_particles(panel, mine, "ns_per_particle_substep", peer)
        panel.set(title=f"{material} {dim}D", xscale="log", ylim=(0, 1.1 * panel.dataLim.y1))
        panel.set(xlabel="particles", ylabel="ns per particle and substep")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    charts.save(figure, file)

"""Speed of the solver: a block in the middle of its splash, at the ground truth's substeps."""

import dataclasses
import math
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridmpm.bench.provenance import Provenance
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene
from hybridmpm.shapes import Box

CASES: tuple[tuple[int, str], ...] = ((2, "water"), (2, "sand"), (3, "water"), (3, "sand"))
"""(dimension, material) of each row."""

_WALL_LOW, _WALL_HIGH = 0.1, 0.9
_RUN_UP = 120
"""Frames before the measurement: the block has hit the floor by then and is spreading."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Size and length of the measurement."""

    particles: int = 4000
    """Aimed at; a row tells how many there were."""
    threads: int = 1
    frames: int = 20
    """Timed in one go."""
    repeats: int = 9
    """The median over these is reported."""


def rows(settings: Settings, source: Provenance) -> Iterator[dict[str, Any]]:
    """Measure each of `CASES` and yield its row; the peer's fields are null until a peer is measured.

    Raises
    ------
    SimulationError
        The state before the measurement is not sane, so its speed would mean nothing.
    """
    for dim, material in CASES:
        solver = MpmSolver(
            falling_block(dim, material, settings.particles), substeps="reference", threads=settings.threads
        )
        solver.advance(_RUN_UP)
        _require_sane(solver)
        seconds = _seconds_per_frame(solver, settings)
        report = solver.last_frame
        substeps = report.substeps if report else 0
        yield {
            "dim": dim,
            "material": material,
            "particles": solver.particle_count,
            "ns_per_particle_substep": round(seconds * 1e9 / (solver.particle_count * substeps), 2),
            "ms_per_frame": round(seconds * 1e3, 4),
            "threads": settings.threads,
            "substeps": substeps,
            "peer": None,
            "peer_ns": None,
            "ratio": None,
            **dataclasses.asdict(source),
        }


def falling_block(dim: int, material: str, particles: int) -> Scene:
    """Scene with one block of at most `particles` particles that falls aslant.

    Raises
    ------
    SceneError
        So many do not fit into the walls.
    """
    resolution = 128 if dim == 2 else 64
    spacing = 0.5 / resolution  # 2**D particles per cell
    sides = [spacing * count for count in _counts(particles, dim)]
    middle = (_WALL_LOW + _WALL_HIGH) / 2
    # On the lattice of the sampler, so that the count is exact.
    lower = [spacing * round((middle - side / 2) / spacing) for side in sides]
    return Scene(
        name=f"falling block of {material}",
        dim=dim,
        bodies=(
            Box(
                material=material,
                lower=tuple(lower),
                upper=tuple(a + side for a, side in zip(lower, sides, strict=True)),
                velocity=(1.0, -2.0, 0.5)[:dim],
            ),
        ),
    )


def _counts(particles: int, dim: int) -> list[int]:
    """Sites along each axis, about equally many, whose product is `particles` or somewhat less."""
    if dim == 1:
        return [particles]
    even = max(1, math.floor(particles ** (1.0 / dim) + 1e-9))
    exact = [count for count in range(even, even // 2, -1) if particles % count == 0]
    count = exact[0] if exact else even
    return [count, *_counts(particles // count, dim - 1)]


def _seconds_per_frame(solver: MpmSolver, settings: Settings) -> float:
    start = solver.snapshot()
    times = []
    for _ in range(settings.repeats + 1):
        solver.restore(start)
        began = time.perf_counter()
        solver.advance(settings.frames)
        times.append((time.perf_counter() - began) / settings.frames)
    return statistics.median(times[1:])  # the first warms the caches up


def _require_sane(solver: MpmSolver) -> None:
    x, v = solver.positions, solver.velocities
    inside = ((x > _WALL_LOW - solver.scene.dx) & (x < _WALL_HIGH + solver.scene.dx)).all()
    if not (inside and np.isfinite(v).all() and 0.05 < np.abs(v).max() < 50):
        raise SimulationError(f"{solver.scene.name}: the state after {solver.frame} frames is not a splash")

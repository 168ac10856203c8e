"""Growth of the cost with the particles and with the cells of the grid."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hybridmpm._support import charts
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Ball, Box, Scene
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import TimedSimulation, time_per_frame

SUBSTEPS = 16
"""Substeps of a frame, each of the ground truth's 0.02 dx: counted in cells, all scenes move alike."""

MAX_PARTICLES = 1_000_000
"""Largest number of particles that a block may be asked to have."""

_WALL_LOW, _WALL_HIGH = 0.1, 0.9
_SHARE = {2: 0.4, 3: 0.2}
"""Part of the box that a block fills, by dimension."""
_BLOB_RADIUS = 8
"""Radius of the blob [cells]; it has about 17 000 particles."""
_RUN_UP = 5
"""Frames before the measurement."""
_PER_MEASUREMENT = 5_000_000
"""Particle-substeps in one measurement; a measurement of one frame may have more."""


@dataclass(frozen=True, kw_only=True)
class ScalingSettings:
    """Sizes and length of the measurement."""

    particles: tuple[int, ...] = (1000, 4000, 16_000, 64_000, 250_000, 1_000_000)
    """Numbers of particles that the blocks should have; the grid grows with the block."""
    resolutions: tuple[int, ...] = (64, 128, 256, 512)
    """Cells along each axis of the grids that hold the same blob."""
    threads: int = 1
    """Threads of the solver."""
    repeats: int = 5
    """Number of timings, whose lower quartile is reported."""

    @property
    def count(self) -> int:
        """Number of rows."""
        return 2 * len(self.particles) + len(self.resolutions)


def measure(settings: ScalingSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure blocks of water that grow and a blob in grids that grow; yield a row for each scene.

    `on_progress` counts rows.
    """
    blocks = [block(dim, particles) for dim in (2, 3) for particles in settings.particles]
    blobs = [blob(resolution) for resolution in settings.resolutions]
    for series, scenes in (("particles", blocks), ("grid", blobs)):
        solvers = [MpmSolver(scene, substeps=SUBSTEPS, threads=settings.threads) for scene in scenes]
        times = time_per_frame([_timed(solver) for solver in solvers], settings.repeats)
        for solver, spent in zip(solvers, times, strict=True):
            per_substep = spent.seconds / SUBSTEPS
            yield {
                "series": series,
                "dim": solver.dim,
                "particles": solver.particle_count,
                "resolution": solver.scene.resolution,
                "threads": settings.threads,
                "ms_per_substep": round(per_substep * 1e3, 5),
                "ns_per_particle_substep": round(per_substep * 1e9 / solver.particle_count, 2),
            }
            on_progress(1)


def _timed(solver: MpmSolver) -> TimedSimulation:
    solver.advance(_RUN_UP)
    start = solver.snapshot()
    frames = min(20, math.ceil(_PER_MEASUREMENT / (SUBSTEPS * solver.particle_count)))
    return TimedSimulation(restore=lambda: solver.restore(start), advance=solver.advance, frames=frames)


def block(dim: int, particles: int) -> Scene:
    """Return a scene with about `particles` particles of water that fall aslant from mid-air."""
    side = (_WALL_HIGH - _WALL_LOW) * _SHARE[dim] ** (1 / dim)
    resolution = max(8, round(particles ** (1 / dim) / (2 * side)))
    middle = (_WALL_LOW + _WALL_HIGH) / 2
    body = Box(
        material="water",
        lower=(middle - side / 2,) * dim,
        upper=(middle + side / 2,) * dim,
        velocity=(1.0, -2.0, 0.5)[:dim],
    )
    return Scene(
        name="block",
        dim=dim,
        resolution=resolution,
        frame_dt=SUBSTEPS * 0.02 / resolution,
        bodies=(body,),
        max_particles=2 * MAX_PARTICLES,
    )


def blob(resolution: int) -> Scene:
    """Return a scene with a ball of water in free fall, whose radius in cells is the same in every grid."""
    ball = Ball(
        material="water", center=(0.5,) * 3, radius=_BLOB_RADIUS / resolution, velocity=(0.0, -2.0, 0.0)
    )
    return Scene(
        name="blob", dim=3, resolution=resolution, frame_dt=SUBSTEPS * 0.02 / resolution, bodies=(ball,)
    )


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw both series as SVG and PNG; raises as `charts.panels` and `charts.save`."""
    figure, axes = charts.panels(columns=3)
    whole, each, around = axes[0]
    for dim, marker in zip((2, 3), charts.MARKERS, strict=False):
        blocks = [row for row in rows if row["series"] == "particles" and row["dim"] == dim]
        particles = [row["particles"] for row in blocks]
        for panel, field in ((whole, "ms_per_substep"), (each, "ns_per_particle_substep")):
            panel.plot(particles, [row[field] for row in blocks], marker=marker, label=f"water {dim}D")
    blobs = [row for row in rows if row["series"] == "grid"]
    nodes = [row["resolution"] for row in blobs]
    around.plot(nodes, [row["ns_per_particle_substep"] for row in blobs], marker=charts.MARKERS[0])
    whole.set(
        xscale="log", yscale="log", xlabel="particles", ylabel="ms per substep", title="growing block, in all"
    )
    whole.legend()
    each.set(
        xscale="log",
        xlabel="particles",
        ylabel="ns per particle and substep",
        title="growing block, each particle",
    )
    around.set(xscale="log", xticks=nodes, xticklabels=[f"${n}^3$" for n in nodes], xlabel="grid")
    around.set(ylabel="ns per particle and substep", title="one blob, growing grid")
    around.minorticks_off()
    for panel in (each, around):
        panel.set_ylim(0, 1.1 * panel.dataLim.y1)
    charts.save(figure, file)

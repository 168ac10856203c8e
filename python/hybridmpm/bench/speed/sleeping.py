"""What sleeping regions save, and what they cost in accuracy: a heap of sand on which one grain falls."""

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics
from hybridmpm._support import charts
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.mpm import MpmSolver, Sleep
from hybridmpm.scene import Box, Scene

_FLOOR, _HEIGHT = 0.1, 0.2
_GROUP = 4
"""Frames timed in one go: the solver decides every fourth frame who sleeps, which takes its own time."""
_RISE = 3.2
"""Speed with which the grain is thrown up [m/s]: it lands after 0.65 s, when the heap is at rest."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Size and length of the measurement."""

    particles: tuple[int, ...] = (4000, 20_000)
    """Of the heaps in 2D; a row tells how many there were."""
    frames: int = 400
    """Of the whole run."""
    stride: int = 12
    """Frames of one row."""


def heap(particles: int, seed: int = 0) -> Scene:
    """Heap of sand in 2D, as wide as its number of particles asks for, and a grain thrown up from it."""
    resolution = 128 if particles <= 10_000 else 256
    spacing = 0.5 / resolution
    width = spacing * round(particles * spacing / _HEIGHT)
    left = spacing * round((1 - width) / 2 / spacing)
    grain = (spacing * round(0.5 / spacing), _FLOOR + spacing * round((_HEIGHT + 0.05) / spacing))
    return Scene(
        name="heap of sand and a grain",
        dim=2,
        resolution=resolution,
        bodies=(
            Box(material="sand", lower=(left, _FLOOR), upper=(left + width, _FLOOR + _HEIGHT), seed=seed),
            Box(
                material="sand",
                lower=grain,
                upper=(grain[0] + spacing, grain[1] + spacing),
                velocity=(0.0, _RISE),
                seed=seed,
            ),
        ),
    )


def rows(
    settings: Settings, source: Provenance, *, on_progress: Callable[[int], object] | None = None
) -> list[dict[str, Any]]:
    """Run each heap awake, sleeping and awake with other jitter, by turns, and return a row per stride.

    `error` is the grid RMSE of the sleeping run against the awake one, `floor` that of the run with other
    jitter: what the ground truth itself leaves open. `ratio` is the time of a frame, sleeping over awake.
    """
    found = []
    for particles in settings.particles:
        awake = MpmSolver(heap(particles), substeps="reference")
        sleeping = MpmSolver(heap(particles), substeps="reference", sleep=Sleep())
        other = MpmSolver(heap(particles, seed=1), substeps="reference")
        for _ in range(settings.frames // settings.stride):
            seconds = [_seconds(solver, settings.stride) for solver in (awake, sleeping)]
            other.advance(settings.stride)
            truth = _mass(awake)
            found.append(
                {
                    "particles": awake.particle_count,
                    "frame": awake.frame,
                    "asleep": round(float(sleeping.asleep.mean()), 4),
                    "ms_awake": round(1e3 * seconds[0], 4),
                    "ms_sleeping": round(1e3 * seconds[1], 4),
                    "ratio": round(seconds[1] / seconds[0], 4),
                    "error": round(metrics.grid_rmse(_mass(sleeping), truth), 5),
                    "floor": round(metrics.grid_rmse(_mass(other), truth), 5),
                    **dataclasses.asdict(source),
                }
            )
            if on_progress is not None:
                on_progress(1)
    return found


def chart(found: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw time, share of sleepers, error and floor over the frames, one column for each heap."""
    sizes = sorted({row["particles"] for row in found})
    figure, axes = charts.panels(len(sizes), 2, width=4.6, height=2.6)
    for (upper, lower), size in zip(axes.T, sizes, strict=True):
        mine = [row for row in found if row["particles"] == size]
        frames = [row["frame"] for row in mine]
        upper.plot(frames, [row["ratio"] for row in mine], label="time of a frame, sleeping / awake")
        upper.plot(frames, [row["asleep"] for row in mine], "--", label="share asleep")
        upper.set(title=f"{size} particles", ylim=(0, 1.1))
        colours = charts.COLOURS[2:]
        lower.plot(frames, [row["error"] for row in mine], color=colours[0], label="error of sleeping")
        lower.plot(frames, [row["floor"] for row in mine], "--", color=colours[1], label="floor")
        lower.set(xlabel="frame", ylabel="grid RMSE", ylim=(0, None))
    handles = [line for axis in axes[:, 0] for line in axis.get_lines()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    charts.save(figure, path)


def _seconds(solver: MpmSolver, frames: int) -> float:
    """Time of a frame [s], the least over groups: what a busy machine adds is not the solver's."""
    groups = []
    for _ in range(frames // _GROUP):
        began = time.perf_counter()
        solver.advance(_GROUP)
        groups.append((time.perf_counter() - began) / _GROUP)
    return min(groups)


def _mass(solver: MpmSolver) -> npt.NDArray[np.float32]:
    x = np.clip(solver.positions, 0, 1)
    return metrics.grid_mass(x, solver.mass, solver.scene.resolution)

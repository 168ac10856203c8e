"""What sleeping regions save, and what they cost in accuracy: a heap of sand on which one grain falls."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hybridmpm import metrics
from hybridmpm._support import charts
from hybridmpm.mpm import MpmSolver, Sleep
from hybridmpm.scene import Box, Scene
from hybridmpm_lab.harness.grid import present_grid_mass
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import Clock

_FLOOR, _HEIGHT = 0.1, 0.2
_GROUP = 4
"""Frames timed in one go: every fourth frame the solver decides who sleeps, which takes its own time."""
_RISE = 3.2
"""Speed with which the grain is thrown up [m/s]: it lands after 0.65 s, when the heap is at rest."""


@dataclass(frozen=True, kw_only=True)
class SleepingSettings:
    """Size and length of the measurement."""

    particles: tuple[int, ...] = (4000, 20_000)
    """Numbers of particles that the heaps should have; a row tells how many there were."""
    frames: int = 400
    """Number of frames of the whole run."""
    stride: int = 12
    """Number of frames that one row tells about."""

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.particles) * (self.frames // self.stride)


def heap(particles: int, seed: int = 0) -> Scene:
    """Return a heap of sand in 2D of about `particles` particles, and a grain thrown up from it."""
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


def measure(settings: SleepingSettings, on_progress: Progress) -> Iterator[Row]:
    """Run each heap awake, sleeping and awake with other jitter, by turns, and yield a row per stride.

    `error` is the grid RMSE of the sleeping run against the awake one, `floor` that of the run with other
    jitter: what the ground truth itself leaves open. `ratio` is the time of a frame, sleeping over awake.
    `on_progress` counts rows.
    """
    for particles in settings.particles:
        awake = MpmSolver(heap(particles), substeps="reference")
        sleeping = MpmSolver(heap(particles), substeps="reference", sleep=Sleep())
        other = MpmSolver(heap(particles, seed=1), substeps="reference")
        for _ in range(settings.frames // settings.stride):
            seconds = [_least_seconds(solver, settings.stride) for solver in (awake, sleeping)]
            other.advance(settings.stride)
            truth = present_grid_mass(awake)
            yield {
                "particles": awake.particle_count,
                "frame": awake.frame,
                "asleep": round(float(sleeping.asleep.mean()), 4),
                "ms_awake": round(1e3 * seconds[0], 4),
                "ms_sleeping": round(1e3 * seconds[1], 4),
                "ratio": round(seconds[1] / seconds[0], 4),
                "error": round(metrics.grid_rmse(present_grid_mass(sleeping), truth), 5),
                "floor": round(metrics.grid_rmse(present_grid_mass(other), truth), 5),
            }
            on_progress(1)


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw time, share of sleepers, error and floor over the frames, as SVG and PNG, a column a heap."""
    sizes = sorted({row["particles"] for row in rows})
    figure, axes = charts.panels(len(sizes), 2, width=4.6, height=2.6)
    for (upper, lower), size in zip(axes.T, sizes, strict=True):
        mine = [row for row in rows if row["particles"] == size]
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
    charts.save(figure, file)


def _least_seconds(solver: MpmSolver, frames: int) -> float:
    """Advance by frames, and return the time of one [s]: the least over groups, as others only add to it."""
    groups: list[float] = []
    for _ in range(frames // _GROUP):
        with Clock(groups):
            solver.advance(_GROUP)
    return min(groups) / _GROUP

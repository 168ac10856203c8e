"""How the cost grows with the work: particles, grid, threads, scenes of a batch, sessions, and pages."""

import asyncio
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

from hybridmpm import MpmBatch, MpmSolver, play, scenarios
from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.browser import launched
from hybridmpm_lab.harness.command import Measurement, measured, setting
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.harness.timing import QUIET, Calibration, TimedCall, seconds_by_turns
from hybridmpm_lab.service.server import running
from hybridmpm_lab.service.viewers import playing
from hybridmpm_lab.speed.playing import page_calls
from hybridmpm_lab.speed.solver import CASES, falling_block

PARTS = ("particles", "grid", "threads", "scenes", "pages", "sessions")
_RUN_UP = 120  # frames before the measurement: the blocks have hit the floor by then and are spreading
_IN_FLIGHT = (
    4  # frames before that of grids: in a splash as many particles would spread over more of finer cells
)
_PIECE = 200_000  # particle-frames of one timing
_GRIDS = {2: (64, 128, 256, 512, 1024), 3: (32, 64, 128, 256)}
_LABELS = {
    "particles": "particles, one thread",
    "grid": "cells along an axis, 4000 particles in flight, one thread",
    "threads": "threads",
    "scenes": "scenes of water_2d in a batch, two threads",
    "pages": "particles of water in 2D, one thread",
    "sessions": "sessions of water_2d at a quarter of real time",
}


@dataclass(frozen=True, kw_only=True)
class ScalingSettings:
    """Parts and sizes of the measurement."""

    part: tuple[str, ...] = setting(PARTS, "What grows.", PARTS)
    particles: tuple[int, ...] = setting(
        (1000, 4000, 16_000, 64_000, 256_000), "Number of particles of a block.", low=64, high=1_000_000
    )
    threads: tuple[int, ...] = setting((1, 2), "Number of threads.", low=1, high=1024)
    scenes: tuple[int, ...] = setting((1, 4, 16, 64, 256), "Number of scenes in a batch.", low=1, high=4096)
    page_particles: tuple[int, ...] = setting(
        (1000, 4000, 16_000), "Number of particles of a page.", low=64, high=100_000
    )
    sessions: tuple[int, ...] = setting((1, 2, 4, 8, 16), "Number of sessions.", low=1, high=16)
    seconds: float = setting(10.0, "Length of a measurement of sessions [s].")
    repeats: int = setting(15, "Number of timings of each.", low=1, high=1000)

    @property
    def steps(self) -> int:
        """Number of parts."""
        return len(self.part)


def measure(settings: ScalingSettings, on_progress: Progress) -> Iterator[Row]:
    """Time each part and yield its rows; `on_progress` counts parts.

    A row is a point: `part`, `line`, `size` (what grows), `value` and its `unit`. `slope` is that of the
    line's fit in logarithms: 1 where the cost grows like the work, 0 where it does not grow.
    """
    points = {
        "particles": _particles,
        "grid": _grid,
        "threads": _threads,
        "scenes": _scenes,
        "pages": _pages,
        "sessions": _sessions,
    }
    calibration = Calibration(2)
    for part in (part for part in PARTS if part in settings.part):
        before = calibration.slowdown()
        found = list(points[part](settings))
        slowdown = round(max(before, calibration.slowdown()), 2)
        slopes = {line: _slope([point[1:3] for point in found if point[0] == line]) for line, *_ in found}
        for line, size, value, unit in found:
            point = {"part": part, "line": line, "size": size, "value": significant(value), "unit": unit}
            yield point | {"slope": slopes[line], "slowdown": slowdown, "loaded": slowdown >= QUIET}
        on_progress(1)


def _slope(points: Sequence[tuple[float, float]]) -> float | None:
    sizes, values = np.log(points).T
    return None if np.ptp(sizes) == 0 else round(float(np.polyfit(sizes, values, 1)[0]), 3)


_Points = Iterator[tuple[str, int, float, str]]


def _particles(settings: ScalingSettings) -> _Points:
    for (dim, of), count in product(CASES, settings.particles):
        solver = MpmSolver(falling_block(dim, of, count), substeps="reference", threads=1)
        (value,) = _of_a_substep([solver], settings.repeats)
        yield f"{of} {dim}D", solver.particle_count, value, "ms a substep"


def _grid(settings: ScalingSettings) -> _Points:
    for dim, of in CASES:
        for resolution in _GRIDS[dim]:
            block = falling_block(dim, of, 4000, resolution)
            solver = MpmSolver(block, substeps="reference", threads=1)
            (value,) = _of_a_substep([solver], settings.repeats, _IN_FLIGHT)
            yield f"{of} {dim}D", resolution, value, "ms a substep"


def _threads(settings: ScalingSettings) -> _Points:
    for (dim, of), count in product(CASES, (4000, 100_000)):
        scene = falling_block(dim, of, count)
        solvers = [MpmSolver(scene, substeps="reference", threads=each) for each in settings.threads]
        values = _of_a_substep(solvers, settings.repeats)
        for each, value in zip(settings.threads, values, strict=True):
            yield f"{of} {dim}D, {count}", each, value, "ms a substep"


def _of_a_substep(solvers: Sequence[MpmSolver], repeats: int, run_up: int = _RUN_UP) -> list[float]:
    """Return the lower quartile of the times that each solver takes for a substep after some frames [ms]."""
    first = solvers[0]
    first.advance(run_up)
    start = first.snapshot()
    first.advance(1)
    substeps = first.last_frame.substeps if first.last_frame else 0
    frames = min(20, max(2, round(_PIECE / first.particle_count)))

    def restore(solver: MpmSolver) -> None:
        solver.restore(start)
        solver.advance(1)

    calls = [
        TimedCall(prepare=partial(restore, each), call=partial(each.advance, frames)) for each in solvers
    ]
    times = seconds_by_turns(calls, repeats)
    return [1e3 * float(np.percentile(each, 25)) / (frames * substeps) for each in times]


def _scenes(settings: ScalingSettings) -> _Points:
    for count in settings.scenes:
        batch = MpmBatch([scenarios.get("water_2d", seed) for seed in range(count)], threads=2)
        batch.advance(_RUN_UP)
        frames = max(1, 64 // count)
        (times,) = seconds_by_turns([TimedCall(call=partial(batch.advance, frames))], settings.repeats)
        yield "batch", count, 1e3 * float(np.percentile(times, 25)) / frames, "ms a frame"


def _pages(settings: ScalingSettings) -> _Points:
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = launched(playwright)
        for count in settings.page_particles:
            solver = MpmSolver(falling_block(2, "water", count))
            solver.advance(_RUN_UP)
            file = Path(folder) / f"{count}.html"
            play(solver, file)
            page = browser.new_page()
            page.goto(file.as_uri())
            page.wait_for_function("() => document.body.dataset.ready === 'true'")
            frames = max(2, min(20, _PIECE // (2 * count)))
            times = seconds_by_turns(page_calls(solver, page, frames), settings.repeats)
            native, there = (1e3 * float(np.percentile(each, 25)) / frames for each in times)
            page.close()
            yield "native", solver.particle_count, native, "ms a frame"
            yield "module in Chromium", solver.particle_count, there, "ms a frame"
        browser.close()


def _sessions(settings: ScalingSettings) -> _Points:
    async def cores(count: int) -> float:
        bodies: list[Row] = [{"scenario": "water_2d", "seed": seed} for seed in range(count)]
        with running() as server:
            async with playing(server.address, bodies, speed=0.25):
                await asyncio.sleep(min(2.0, settings.seconds))
                start, before = time.perf_counter(), server.computed()
                await asyncio.sleep(settings.seconds)
                return (server.computed() - before) / (time.perf_counter() - start)

    for count in settings.sessions:
        yield "server", count, asyncio.run(cores(count)), "cores"


def draw(rows: Sequence[Row], file: Path) -> None:
    """Draw a panel for each part, in logarithms, with the slope of each line in its label."""
    parts = list(dict.fromkeys(row["part"] for row in rows))
    columns = min(2, len(parts))
    figure, axes = charts.panels(columns, -(-len(parts) // columns), width=5.0, height=3.4)
    for axis in axes.flat[len(parts) :]:
        axis.remove()
    for axis, part in zip(axes.flat, parts, strict=False):
        here = [row for row in rows if row["part"] == part]
        lines = dict.fromkeys(row["line"] for row in here)
        for line, marker in zip(lines, charts.MARKERS, strict=False):
            mine = sorted((row["size"], row["value"], row["slope"]) for row in here if row["line"] == line)
            slope = mine[0][2]
            label = line if slope is None else f"{line}: {slope:.2f}"
            axis.plot([one[0] for one in mine], [one[1] for one in mine], marker=marker, label=label)
        axis.set(xscale="log", yscale="log", xlabel=_LABELS[part], ylabel=here[0]["unit"])
        if max(row["size"] for row in here) < 100 * min(row["size"] for row in here):  # else they overlap
            charts.plain_log_ticks(axis.xaxis)
        charts.plain_log_ticks(axis.yaxis)
        if len(lines) > len(CASES):  # room for the legend below
            axis.set_ylim(bottom=min(row["value"] for row in here) / 8)
        where = {"loc": "lower center", "ncols": 2} if len(lines) > len(CASES) else {}
        axis.legend(title="slope", fontsize=8, title_fontsize=8, **where)
    charts.save(figure, file)


scaling = Measurement(
    name="scaling",
    settings=ScalingSettings,
    measure=measured(measure),
    columns=("part", "line", "size", "value", "unit", "slope", "slowdown", "loaded"),
    draw=draw,
    summary="""Time how the cost grows: with particles, grid, threads, scenes, pages and sessions.

    Blocks of water and sand are timed in mid-splash at the ground truth's substeps, by the lower quartile.
    Slopes are those of straight lines in logarithms.
    """,
).command()

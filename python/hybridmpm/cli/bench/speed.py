"""`hybridmpm bench` on speed: mpm, scaling, batch, neighbors, sleeping."""

from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.bench.speed import batch as batch_bench
from hybridmpm.bench.speed import mpm as mpm_bench
from hybridmpm.bench.speed import neighbors as neighbors_bench
from hybridmpm.bench.speed import scaling as scaling_bench
from hybridmpm.bench.speed import sleeping as sleeping_bench
from hybridmpm.cli.bench.options import (
    chart_option,
    json_option,
    many,
    measured,
    repeats_option,
    report,
    source,
)
from hybridmpm.cli.progress import progress

_MPM_COLUMNS = (
    "dim", "material", "particles", "resolution", "threads", "substeps", "ns_per_particle_substep",
    "ms_per_frame",
)  # fmt: skip
_PEER_COLUMNS = ("peer", "peer_ns", "peer_threads", "ratio")
_SCALING_COLUMNS = (
    "series", "dim", "particles", "resolution", "threads", "ms_per_substep", "ns_per_particle_substep",
)  # fmt: skip
_SLEEPING_COLUMNS = ("particles", "frame", "asleep", "ms_awake", "ms_sleeping", "ratio", "error", "floor")
_BATCH_COLUMNS = (
    "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second", "speedup",
)  # fmt: skip
_NEIGHBORS_COLUMNS = (
    "dim", "particles", "radius", "edges", "threads", "ms", "ms_reused", "ms_verlet",
)  # fmt: skip


@click.command()
@many("--particles", click.IntRange(64, mpm_bench.MAX_PARTICLES), mpm_bench.Settings.particles, "Sizes.")
@many("--threads", click.IntRange(1, 1024), mpm_bench.Settings.threads, "Of our solver.")
@click.option("--peer", type=click.Choice(["taichi"]), help="Measure it beside ours, by turns.")
@repeats_option
@json_option
@chart_option
def mpm(
    *,
    particles: tuple[int, ...],
    threads: tuple[int, ...],
    peer: str | None,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the solver on water and sand in 2D and 3D, mid-splash, at the ground truth's substeps."""
    settings = mpm_bench.Settings(particles=particles, threads=threads, repeats=repeats, peer=peer)
    if peer is not None:
        mpm_bench.peer_module(peer)
    origin = source("mpm", particles=particles, threads=threads, repeats=(repeats,), peer=(peer,))
    rows = measured(mpm_bench.rows(settings, origin), len(mpm_bench.CASES) * len(particles) * len(threads))
    report(rows, _MPM_COLUMNS + (_PEER_COLUMNS if peer else ()), origin, json_file)
    if chart_file is not None:
        mpm_bench.chart(rows, chart_file)


@click.command()
@many(
    "--particles",
    click.IntRange(512, scaling_bench.MAX_PARTICLES),
    scaling_bench.Settings.particles,
    "Of blocks whose grid grows with them.",
)
@many(
    "--resolution",
    click.IntRange(32, 256),
    scaling_bench.Settings.resolutions,
    "Cells along the grids around one blob.",
)
@click.option("--threads", type=click.IntRange(1, 1024), default=1, show_default=True)
@repeats_option
@json_option
@chart_option
def scaling(
    *,
    particles: tuple[int, ...],
    resolution: tuple[int, ...],
    threads: int,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time growing blocks of water, and one blob of water in growing grids."""
    settings = scaling_bench.Settings(
        particles=particles, resolutions=resolution, threads=threads, repeats=repeats
    )
    origin = source(
        "scaling", particles=particles, resolution=resolution, threads=(threads,), repeats=(repeats,)
    )
    rows = measured(scaling_bench.rows(settings, origin), 2 * len(particles) + len(resolution))
    report(rows, _SCALING_COLUMNS, origin, json_file)
    if chart_file is not None:
        scaling_bench.chart(rows, chart_file)


@click.command()
@click.argument("scenario", default="water_2d", type=click.Choice(scenarios.NAMES))
@click.option("--scenes", type=click.IntRange(1, 1000), default=16, show_default=True)
@click.option("--threads", type=click.IntRange(2, 1024), default=2, show_default=True, help="Against one.")
@click.option(
    "--frames", type=click.IntRange(1, 1000), default=10, show_default=True, help="Timed in one go."
)
@repeats_option
@json_option
def batch(
    *, scenario: str, scenes: int, threads: int, frames: int, repeats: int, json_file: Path | None
) -> None:
    """Time many scenes of SCENARIO, in the middle of their splash, on one thread and on several."""
    settings = batch_bench.Settings(
        scenario=scenario, scenes=scenes, threads=threads, frames=frames, repeats=repeats
    )
    origin = source(
        f"batch {scenario}", scenes=(scenes,), threads=(threads,), frames=(frames,), repeats=(repeats,)
    )
    with progress("Measuring", repeats) as bar:
        rows = batch_bench.rows(settings, origin, on_progress=bar.update)
    report(rows, _BATCH_COLUMNS, origin, json_file)


@click.command()
@many(
    "--particles",
    click.IntRange(64, neighbors_bench.MAX_PARTICLES),
    neighbors_bench.Settings.particles,
    "Sizes.",
)
@many("--threads", click.IntRange(1, 1024), neighbors_bench.Settings.threads, "Of ours.")
@click.option("--peer", type=click.Choice(["scipy"]), help="Measure it beside ours, by turns.")
@click.option(
    "--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, help="The least is reported."
)
@json_option
@chart_option
def neighbors(
    *,
    particles: tuple[int, ...],
    threads: tuple[int, ...],
    peer: str | None,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the radius graph of clouds in 2D and 3D: fresh, into used memory, and from a Verlet list."""
    settings = neighbors_bench.Settings(particles=particles, threads=threads, repeats=repeats, peer=peer)
    if peer is not None:
        neighbors_bench.peer_module(peer)
    origin = source("neighbors", particles=particles, threads=threads, repeats=(repeats,), peer=(peer,))
    rows = measured(neighbors_bench.rows(settings, origin), 2 * len(particles) * len(threads))
    columns = ("peer", "peer_ms", "ratio") if peer else ()
    report(rows, _NEIGHBORS_COLUMNS + columns, origin, json_file)
    if chart_file is not None:
        neighbors_bench.chart(rows, chart_file)


@click.command()
@many("--particles", click.IntRange(500, 100_000), sleeping_bench.Settings.particles, "Of the heaps.")
@click.option("--frames", type=click.IntRange(10, 10_000), default=400, show_default=True)
@json_option
@chart_option
def sleeping(
    *, particles: tuple[int, ...], frames: int, json_file: Path | None, chart_file: Path | None
) -> None:
    """Let a grain fall on a heap of sand at rest, with regions that sleep and without."""
    settings = sleeping_bench.Settings(particles=particles, frames=frames)
    origin = source("sleeping", particles=particles, frames=(frames,))
    with progress("Measuring", len(particles) * (frames // settings.stride)) as bar:
        rows = sleeping_bench.rows(settings, origin, on_progress=bar.update)
    report(rows, _SLEEPING_COLUMNS, origin, json_file)
    if chart_file is not None:
        sleeping_bench.chart(rows, chart_file)

"""`python -m hybridmpm_lab` on speed: speed, scaling, batch, graph."""

from functools import partial
from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    measured,
    number_option,
    numbers_option,
    report,
    source,
)
from hybridmpm_lab.speed import batch as batch_speed
from hybridmpm_lab.speed import chart, solver
from hybridmpm_lab.speed import graph as graph_speed
from hybridmpm_lab.speed.baselines import SEARCHES, SOLVERS, require_installed

_TIMES = (
    "particles", "resolution", "threads", "instructions", "substeps", "ns_per_particle_substep", "spread",
    "ms_per_frame", "slowdown", "loaded",
)  # fmt: skip
_threads_option = numbers_option("--threads", 1, 1024, (1, 2), "Number of threads of ours.")
_repeats_option = number_option("--repeats", 1, 1000, 9, "Number of timings of each.")


@click.command()
@numbers_option("--particles", 64, solver.MAX_PARTICLES, (4000, 100_000), "Number of particles of a block.")
@numbers_option("--frame", 0, 10_000, (120,), "Frames before: at 0 the block flies, at 120 it splashes.")
@_threads_option
@click.option(
    "--instructions",
    type=click.Choice(solver.INSTRUCTIONS),
    multiple=True,
    default=solver.INSTRUCTIONS[-1:],
    show_default=True,
    help="Widest vector instructions of our solver. May be given several times.",
)
@click.option(
    "--baseline",
    "baselines",
    type=click.Choice(SOLVERS),
    multiple=True,
    help="Package of a plain solver to be timed by turns with ours. May be given several times.",
)
@_repeats_option
@json_option
@chart_option
def speed(
    *,
    particles: tuple[int, ...],
    frame: tuple[int, ...],
    threads: tuple[int, ...],
    instructions: tuple[str, ...],
    baselines: tuple[str, ...],
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the solver on splashing blocks.

    The blocks are of water and sand, in 2D and 3D; the solver takes the ground truth's substeps. All that is
    timed takes turns, in pieces of up to 20 frames, whose lower quartile counts. A row is marked as loaded
    where the machine was busy before or after.
    """
    for name in baselines:
        require_installed(name)
    settings = solver.Settings(
        threads=threads, instructions=instructions, repeats=repeats, baselines=baselines
    )
    options = {"particles": particles, "frame": frame, "threads": threads, "instructions": instructions}
    origin = source("speed", **options, repeats=(repeats,), baseline=baselines)
    subjects = solver.splashes(particles, frame)
    rows = measured(partial(solver.measure, subjects, settings), settings.rows_of(subjects), origin)
    beside = ("peer", "peer_way", "peer_ns", "ratio") if baselines else ()
    columns = ("dim", "material", "frame", *_TIMES, *beside)
    report(rows, columns, origin, json_file, chart_file=chart_file, draw=chart.draw_solver)


@click.command()
@numbers_option(
    "--particles",
    512,
    solver.MAX_PARTICLES,
    (1000, 4000, 16_000, 64_000, 250_000, 1_000_000),
    "Number of particles of a block, whose grid grows with it.",
)
@numbers_option(
    "--resolution", 32, 512, (64, 128, 256, 512), "Cells along each axis of a grid around a blob."
)
@_threads_option
@_repeats_option
@json_option
@chart_option
def scaling(
    *,
    particles: tuple[int, ...],
    resolution: tuple[int, ...],
    threads: tuple[int, ...],
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the solver on scenes that grow.

    Blocks of water grow together with their grids; then the same blob of water is put into growing grids.
    """
    settings = solver.Settings(threads=threads, repeats=repeats)
    sizes = {"particles": particles, "resolution": resolution, "threads": threads}
    origin = source("scaling", **sizes, repeats=(repeats,))
    subjects = solver.growing(particles, resolution)
    rows = measured(partial(solver.measure, subjects, settings), settings.rows_of(subjects), origin)
    report(
        rows, ("series", "dim", *_TIMES), origin, json_file, chart_file=chart_file, draw=chart.draw_growing
    )


@click.command()
@click.argument("scenario", default="water_2d", type=click.Choice(scenarios.NAMES), metavar="[SCENARIO]")
@numbers_option("--scenes", 1, 4096, (16,), "Number of scenes of the scenario.")
@number_option("--threads", 2, 1024, 2, "Number of threads that one thread is compared with.")
@number_option("--frames", 1, 1000, 10, "Number of frames timed in one go.")
@_repeats_option
@json_option
def batch(
    *, scenario: str, scenes: tuple[int, ...], threads: int, frames: int, repeats: int, json_file: Path | None
) -> None:
    """Time many scenes on one thread and on several.

    SCENARIO is one of those that `hybridmpm scenarios` lists, water_2d if absent. The scenes are timed in
    the middle of their splash.
    """
    options = {"scenes": scenes, "threads": (threads,), "frames": (frames,), "repeats": (repeats,)}
    origin = source(f"batch {scenario}", **options)
    settings = batch_speed.Settings(scenario, scenes, threads, frames, repeats)
    measure = partial(batch_speed.measure, settings)
    rows = measured(measure, repeats * len(scenes), origin)
    columns = (
        "scenario",
        "scenes",
        "particles",
        "threads",
        "ms_per_scene_frame",
        "frames_per_second",
        "speedup",
    )
    report(rows, columns, origin, json_file)


@click.command()
@numbers_option(
    "--particles",
    64,
    10_000_000,
    (4000, 20_000, 100_000, 300_000, 1_000_000),
    "Number of points of a cloud.",
)
@_threads_option
@click.option("--baseline", type=click.Choice(SEARCHES), help="Search to be timed by turns with ours.")
@_repeats_option
@json_option
@chart_option
def neighbors(
    *,
    particles: tuple[int, ...],
    threads: tuple[int, ...],
    baseline: str | None,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the radius graph of clouds of points.

    Timed are a fresh graph (ms), and one into the memory of the last (ms_reused), in 2D and 3D.
    """
    if baseline is not None:
        require_installed(baseline)
    options = {"particles": particles, "threads": threads, "repeats": (repeats,), "baseline": (baseline,)}
    origin = source("neighbors", **options)
    measure = partial(graph_speed.measure, particles, threads, repeats, baseline)
    rows = measured(measure, 2 * len(particles) * len(threads), origin)
    beside = ("peer", "peer_ms", "ratio") if baseline else ()
    columns = ("dim", "particles", "radius", "edges", "threads", "ms", "ms_reused", *beside)
    report(rows, columns, origin, json_file, chart_file=chart_file, draw=chart.draw_graph)

"""`hybridmpm bench` on speed: mpm, scaling, batch, neighbors, sleeping."""

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
    print_origin,
    print_table,
    report,
    save,
    source,
    threads_option,
)
from hybridmpm_lab.harness.provenance import other_commit
from hybridmpm_lab.speed import batch as batch_bench
from hybridmpm_lab.speed import mpm as mpm_bench
from hybridmpm_lab.speed import neighbors as neighbors_bench
from hybridmpm_lab.speed import scaling as scaling_bench
from hybridmpm_lab.speed import sleeping as sleeping_bench
from hybridmpm_lab.speed.baselines.loading import SOLVERS, check_peer
from hybridmpm_lab.speed.blocks import MAX_PARTICLES

_MPM_COLUMNS = (
    "dim", "material", "particles", "frame", "threads", "instructions", "substeps", "ns_per_particle_substep",
    "spread", "ms_per_frame", "slowdown", "loaded",
)  # fmt: skip
_PEER_COLUMNS = ("peer", "peer_setting", "peer_ns", "ratio")
_BUILD_COLUMNS = ("build_ns", "build_ratio")
_SCALING_COLUMNS = (
    "series", "dim", "particles", "resolution", "threads", "ms_per_substep", "ns_per_particle_substep",
)  # fmt: skip
_SLEEPING_COLUMNS = ("particles", "frame", "asleep", "ms_awake", "ms_sleeping", "ratio", "error", "floor")
_BATCH_COLUMNS = (
    "scenario", "scenes", "particles", "threads", "ms_per_scene_frame", "frames_per_second", "speedup",
)  # fmt: skip
_NEIGHBORS_COLUMNS = (
    "dim", "particles", "radius", "edges", "threads", "ms", "ms_reused",
)  # fmt: skip
_NEIGHBORS_PEER_COLUMNS = ("peer", "peer_ms", "ratio")

_quartile_option = number_option("--repeats", 1, 1000, 9, "Number of timings, whose lower quartile counts.")
_least_option = number_option("--repeats", 1, 1000, 9, "Number of timings, the least of which is reported.")


@click.command()
@numbers_option(
    "--particles", 64, MAX_PARTICLES, mpm_bench.MpmSettings.particles, "Number of particles of a block."
)
@numbers_option(
    "--frame",
    0,
    10_000,
    mpm_bench.MpmSettings.run_up,
    "Number of frames that go before: at 0 the block flies, at 120 it splashes.",
)
@numbers_option("--threads", 1, 1024, mpm_bench.MpmSettings.threads, "Number of threads of our solver.")
@click.option(
    "--instructions",
    type=click.Choice(mpm_bench.INSTRUCTIONS),
    multiple=True,
    default=mpm_bench.MpmSettings.instructions,
    show_default=True,
    help="Widest vector instructions that our solver may use. May be given several times.",
)
@click.option(
    "--peer",
    "peers",
    type=click.Choice(SOLVERS),
    multiple=True,
    help="Package of a plain solver to be timed by turns with ours. May be given several times.",
)
@click.option(
    "--build",
    type=click.Path(file_okay=False, exists=True, path_type=Path),
    metavar="FOLDER",
    help="Checkout of another version of hybridmpm, built, to be timed by turns with this one.",
)
@number_option(
    "--repeats",
    1,
    1000,
    mpm_bench.MpmSettings.repeats,
    "Number of timings of each, whose lower quartile counts.",
)
@json_option
@chart_option
def speed(
    *,
    particles: tuple[int, ...],
    frame: tuple[int, ...],
    threads: tuple[int, ...],
    instructions: tuple[str, ...],
    peers: tuple[str, ...],
    build: Path | None,
    repeats: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Time the solver on splashing blocks.

    The blocks are of water and sand, in 2D and 3D; the solver takes the ground truth's substeps. All that is
    timed takes turns, in pieces of up to 20 frames. A row is marked as loaded where the machine was busy
    before or after.
    """
    settings = mpm_bench.MpmSettings(
        particles=particles,
        run_up=frame,
        threads=threads,
        instructions=instructions,
        repeats=repeats,
        peers=peers,
        build=build,
    )
    settings.check()
    options = {
        "particles": particles,
        "frame": frame,
        "threads": threads,
        "instructions": instructions,
        "repeats": (repeats,),
        "peer": peers,
    }
    origin = source("speed", **options, build=() if build is None else (other_commit(build),))
    rows = measured(partial(mpm_bench.measure, settings), settings.count, origin)
    columns = _MPM_COLUMNS + (_PEER_COLUMNS if peers else ()) + (_BUILD_COLUMNS if build else ())
    report(rows, columns, origin, json_file, chart_file=chart_file, draw=mpm_bench.chart)


@click.command()
@numbers_option(
    "--particles",
    512,
    scaling_bench.MAX_PARTICLES,
    scaling_bench.ScalingSettings.particles,
    "Number of particles of a block, whose grid grows with it.",
)
@numbers_option(
    "--resolution",
    32,
    512,
    scaling_bench.ScalingSettings.resolutions,
    "Cells along each axis of a grid around the blob.",
)
@threads_option("Number of threads of the solver.")
@_quartile_option
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
    """Time the solver on scenes that grow.

    Blocks of water grow together with their grids; then the same blob of water is put into growing grids. At
    last the time is taken that short pieces of work need which threads share, as in a substep.
    """
    settings = scaling_bench.ScalingSettings(
        particles=particles, resolutions=resolution, threads=threads, repeats=repeats
    )
    origin = source(
        "scaling", particles=particles, resolution=resolution, threads=(threads,), repeats=(repeats,)
    )
    rows = measured(partial(scaling_bench.measure, settings), settings.count, origin)
    save(rows, json_file, chart_file, scaling_bench.chart)
    print_table(rows, _SCALING_COLUMNS)
    print_origin(origin)


@click.command()
@click.argument("scenario", default="water_2d", type=click.Choice(scenarios.NAMES), metavar="[SCENARIO]")
@numbers_option("--scenes", 1, 4096, batch_bench.BatchSettings.scenes, "Number of scenes of the scenario.")
@number_option("--threads", 2, 1024, 2, "Number of threads that one thread is compared with.")
@number_option("--frames", 1, 1000, 10, "Number of frames timed in one go.")
@_least_option
@json_option
def batch(
    *, scenario: str, scenes: tuple[int, ...], threads: int, frames: int, repeats: int, json_file: Path | None
) -> None:
    """Time many scenes on one thread and on several.

    SCENARIO is one of those that `hybridmpm scenarios` lists, water_2d if absent. The scenes are timed in
    the middle of their splash.
    """
    settings = batch_bench.BatchSettings(
        scenario=scenario, scenes=scenes, threads=threads, frames=frames, repeats=repeats
    )
    origin = source(
        f"batch {scenario}", scenes=scenes, threads=(threads,), frames=(frames,), repeats=(repeats,)
    )
    rows = measured(partial(batch_bench.measure, settings), repeats * len(scenes), origin)
    report(rows, _BATCH_COLUMNS, origin, json_file)


@click.command()
@numbers_option(
    "--particles",
    64,
    neighbors_bench.MAX_PARTICLES,
    neighbors_bench.NeighborsSettings.particles,
    "Number of points of a cloud.",
)
@numbers_option(
    "--threads", 1, 1024, neighbors_bench.NeighborsSettings.threads, "Number of threads of our search."
)
@click.option(
    "--peer",
    type=click.Choice([neighbors_bench.PEER]),
    help="Search of others to be timed by turns with ours.",
)
@_least_option
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
    """Time the radius graph of clouds of points.

    The clouds are in 2D and 3D. Timed are a fresh graph (ms) and one into the memory of the last (ms_reused).
    """
    settings = neighbors_bench.NeighborsSettings(
        particles=particles, threads=threads, repeats=repeats, peer=peer
    )
    if peer is not None:
        check_peer(peer, known=(neighbors_bench.PEER,))
    origin = source("neighbors", particles=particles, threads=threads, repeats=(repeats,), peer=(peer,))
    rows = measured(partial(neighbors_bench.measure, settings), settings.count, origin)
    report(
        rows,
        _NEIGHBORS_COLUMNS + (_NEIGHBORS_PEER_COLUMNS if peer else ()),
        origin,
        json_file,
        chart_file=chart_file,
        draw=neighbors_bench.chart,
    )


@click.command()
@numbers_option(
    "--particles",
    500,
    100_000,
    sleeping_bench.SleepingSettings.particles,
    "Number of particles of a heap.",
)
@number_option("--frames", 10, 10_000, 400, "Number of frames of the whole run.")
@json_option
@chart_option
def sleeping(
    *, particles: tuple[int, ...], frames: int, json_file: Path | None, chart_file: Path | None
) -> None:
    """Measure what sleeping regions save.

    A grain falls on a heap of sand at rest, in a run with regions that sleep and in one without. Reported are
    the time of a frame in both runs, the share of sleeping particles, the error of the run that sleeps, and
    the floor of that error: the difference that other jitter of the particles makes.
    """
    settings = sleeping_bench.SleepingSettings(particles=particles, frames=frames)
    origin = source("sleeping", particles=particles, frames=(frames,))
    rows = measured(partial(sleeping_bench.measure, settings), settings.count, origin)
    report(rows, _SLEEPING_COLUMNS, origin, json_file, chart_file=chart_file, draw=sleeping_bench.chart)

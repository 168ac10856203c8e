"""`hybridmpm bench sweep`."""

from pathlib import Path

import click

from hybridmpm.bench.sweep.family import POINTS, SweepSettings, matching
from hybridmpm.bench.sweep.results import SweepResults
from hybridmpm.cli.bench.options import (
    chart_option,
    json_option,
    number_option,
    report,
    source,
    threads_option,
)
from hybridmpm.cli.devices import device_option, require_torch, torch_device
from hybridmpm.cli.progress import progress
from hybridmpm.errors import ConfigError

_COLUMNS = (
    "scenario", "method", "label", "trained", "minutes", "parameters", "ms_per_frame", "ms_p95",
    "ms_per_call", "error", "error_se", "error_40", "error_100", "below_zero_40", "below_zero_100", "as_good",
    "dominated_by",
)  # fmt: skip


@click.command()
@click.option(
    "--results",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    metavar="FOLDER",
    help="Folder of the points' results. Points that it holds are not measured again.",
)
@click.option(
    "--points",
    "patterns",
    multiple=True,
    metavar="PATTERN",
    help=f"Measure only points whose name matches, such as {POINTS[0].key} or 'sand_2d-t8-*-32x3-*'. "
    "May be given several times.",
)
@click.option(
    "--minutes-per-point",
    "minutes",
    type=click.FloatRange(0, 100_000),
    default=0.0,
    show_default=True,
    help="Minutes of training of each point; with 0 only latencies are measured. Points that have had less "
    "are trained anew.",
)
@click.option("--survivors", is_flag=True, help="Measure only points that no other trained point dominates.")
@number_option("--scenes", 1, 1000, SweepSettings.scenes, "Number of test scenes of each scenario.")
@number_option(
    "--span", 40, 10_000, SweepSettings.span, "Number of frames of each scene that errors count over."
)
@threads_option("Number of threads of every simulator that is measured.")
@number_option(
    "--relaxations", 0, 16, SweepSettings.relaxations, "Rounds of relaxation after each step of a network."
)
@number_option(
    "--trajectories", 1, 100_000, SweepSettings.trajectories, "Number of trajectories of each training."
)
@device_option
@click.option(
    "--worthwhile",
    is_flag=True,
    help="Train only points that are quicker than MPM with all particles: no error could save the others.",
)
@click.option(
    "--untimed", is_flag=True, help="Leave latencies to a later call, on a machine where nothing else runs."
)
@json_option
@chart_option
def sweep(
    *,
    folder: Path,
    patterns: tuple[str, ...],
    minutes: float,
    survivors: bool,
    device: str,
    untimed: bool,
    worthwhile: bool,
    json_file: Path | None,
    chart_file: Path | None,
    **options: int,
) -> None:
    """Measure time and error of a whole family of networks.

    The points of the family differ in r_t, r_p, size and radius; beside them run MPM and free fall. Errors
    count from the first impact on, in scenes that no data set contains. After an interruption the same
    command goes on where it stopped.
    """
    torch = require_torch()
    from hybridmpm.bench.sweep.chart import chart  # noqa: PLC0415
    from hybridmpm.bench.sweep.runner import SweepRunner  # noqa: PLC0415 - needs torch

    settings = SweepSettings(**options)
    points = matching(patterns)
    runner = SweepRunner(folder / "training", settings, torch_device(torch, device))
    results = SweepResults(folder, settings)
    if survivors:
        best = results.survivors()
        if not best:
            raise ConfigError(
                "no point has been both trained and timed yet; first run the sweep with --minutes-per-point, "
                "without --survivors and --untimed"
            )
        points = [point for point in points if point in best]
    origin = source(
        "sweep --survivors" if survivors else "sweep",
        results=(folder.name,),
        points=patterns,
        **{"minutes-per-point": (f"{minutes:g}",)},
        **{name: (value,) for name, value in options.items()},
    )
    if not untimed:
        with progress("Timing", len(results.untimed(points))) as bar:
            results.time(points, runner, origin, bar.update)
    if worthwhile:
        points = results.worthwhile(points)
        if not points:
            raise ConfigError(
                "none of the points is known to be quicker than MPM with all particles; choose others with "
                "--points, or leave out --untimed to have them timed first"
            )
    with progress("Training", len(results.untrained(points, minutes))) as bar:
        results.train(points, minutes, runner, origin, bar.update)
    rows = results.rows()
    report(rows, _COLUMNS, origin, json_file, chart_file=chart_file, draw=chart)

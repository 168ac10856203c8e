"""`hybridmpm bench sweep`."""

from pathlib import Path

import click

from hybridmpm.bench.sweep.sweep import POINTS, Settings, Sweep, matching
from hybridmpm.cli.bench.options import chart_option, json_option, report, source
from hybridmpm.cli.devices import require_torch, torch_device
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
    help="Where each point is kept; what is there is not measured again.",
)
@click.option(
    "--points",
    "patterns",
    multiple=True,
    metavar="PATTERN",
    help=f"Only these, such as {POINTS[0].key} or 'sand_2d-t8-*-32x3-*'. May be given several times.",
)
@click.option(
    "--minutes-per-point",
    "minutes",
    type=click.FloatRange(0, 100_000),
    default=0.0,
    show_default=True,
    help="Of training. With 0 only latencies are measured. Points with less are redone.",
)
@click.option("--survivors", is_flag=True, help="Only points that no other trained point dominates.")
@click.option(
    "--scenes",
    type=click.IntRange(1, 1000),
    default=Settings.scenes,
    show_default=True,
    help="Of a scenario.",
)
@click.option(
    "--span",
    type=click.IntRange(40, 10_000),
    default=Settings.span,
    show_default=True,
    help="Frames counted.",
)
@click.option("--threads", type=click.IntRange(1, 1024), default=1, show_default=True, help="When measured.")
@click.option("--relaxations", type=click.IntRange(0, 16), default=Settings.relaxations, show_default=True)
@click.option(
    "--trajectories",
    type=click.IntRange(1, 100_000),
    default=Settings.trajectories,
    show_default=True,
    help="To train on.",
)
@click.option("--device", default="auto", show_default=True, help="To train on: cpu, cuda or auto.")
@click.option(
    "--worthwhile",
    is_flag=True,
    help="Train only points that are quicker than MPM with all particles: no error could save others.",
)
@click.option("--untimed", is_flag=True, help="Leave latencies to a later call, when nothing else runs.")
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
    """Measure error and latency of networks over r_t, r_p, sizes and radii, beside MPM and free fall.

    The same command goes on where it was interrupted. Errors are those of test scenes from their first impact
    on, which every network has to predict.
    """
    torch = require_torch()
    from hybridmpm.bench.sweep.chart import chart  # noqa: PLC0415
    from hybridmpm.bench.sweep.runner import Laboratory  # noqa: PLC0415 - needs torch

    settings = Settings(**options)
    points = matching(patterns)
    laboratory = Laboratory(folder / "training", settings, torch_device(torch, device))
    results = Sweep(folder, settings)
    if survivors:
        best = results.survivors()
        if not best:
            raise ConfigError(
                "no point has been both trained and timed yet; first give --minutes-per-point, without "
                "--survivors and --untimed"
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
            results.time(points, laboratory, origin, bar.update)
    if worthwhile:
        points = results.worthwhile(points)
        if not points:
            raise ConfigError(
                "none of the points is known to be quicker than MPM with all particles; choose others with "
                "--points, or leave out --untimed to have them timed first"
            )
    with progress("Training", len(results.untrained(points, minutes))) as bar:
        results.train(points, minutes, laboratory, origin, bar.update)
    rows = results.rows()
    report(rows, _COLUMNS, origin, json_file)
    if chart_file is not None:
        chart(rows, chart_file)

"""`hybridmpm bench` on the hybrid simulator: safeguard, handoff, hybrid."""

from pathlib import Path
from typing import get_args

import click

from hybridmpm import scenarios
from hybridmpm.bench.hybrid import handoff as handoff_bench
from hybridmpm.bench.hybrid import hybrid as hybrid_bench
from hybridmpm.bench.hybrid import safeguard as safeguard_bench
from hybridmpm.bench.hybrid import safeguard_chart
from hybridmpm.bench.report.provenance import write_rows
from hybridmpm.cli.bench.options import chart_option, json_option, report, source
from hybridmpm.cli.progress import progress
from hybridmpm.hybrid.guards import Safeguard

_PARTS = {
    "cost": ("scenario", "guard", "particles", "us_per_frame", "share_of_mpm"),
    "correlation": ("scenario", "guard", "spearman", "points"),
    "delay": ("event", "scene", "guard", "impact", "delay", "alarms_before"),
    "false alarms": ("scene", "guard", "frames", "alarms"),
}
_HANDOFF_COLUMNS = (
    "material", "phase", "handoff", "kinetic_1", "kinetic_4", "kinetic_16", "grid_1", "grid_4", "grid_16",
    "acceleration", "acceleration_mpm",
)  # fmt: skip
_HYBRID_COLUMNS = ("scenario", "method", "ms_per_frame", "seconds", "mpm_share", "frame", "error")
_TOLD = 50
"""Frames between two lines of the table of a rollout."""

_model_option = click.option(
    "--model",
    metavar="NAME",
    help="A model's name or an ONNX file; zero is free fall. The first that serves each scenario if absent.",
)


@click.command()
@_model_option
@click.option(
    "--scenario",
    type=click.Choice(scenarios.NAMES),
    multiple=True,
    default=scenarios.NAMES,
    show_default=True,
    help="May be given several times.",
)
@click.option(
    "--scenes", type=click.IntRange(1, 1000), default=3, show_default=True, help="Of each scenario."
)
@click.option("--frames", type=click.IntRange(60, 10_000), default=200, show_default=True)
@json_option
@chart_option
def safeguard(
    *,
    model: str | None,
    scenario: tuple[str, ...],
    scenes: int,
    frames: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Tell what guards cost, how they go with the error, when they notice impacts, and false alarms."""
    settings = safeguard_bench.Settings(model=model, scenarios=scenario, scenes=scenes, frames=frames)
    origin = source("safeguard", model=(model,), scenario=scenario, scenes=(scenes,), frames=(frames,))
    with progress("Measuring", settings.count) as bar:
        rows = list(safeguard_bench.rows(settings, origin, bar.update))
    if json_file is not None:
        write_rows(json_file, rows)
    if chart_file is not None:
        safeguard_chart.chart(rows, chart_file)
    for part, columns in _PARTS.items():
        click.echo(f"\n{part}")
        report([row for row in rows if row["part"] == part], columns, origin, None)


@click.command()
@json_option
@chart_option
def handoff(*, json_file: Path | None, chart_file: Path | None) -> None:
    """Measure the shock of handing over from a network to MPM, with what state is carried and without."""
    origin = source("handoff")
    with progress("Measuring", handoff_bench.COUNT) as bar:
        rows = list(handoff_bench.rows(origin, bar.update))
    report(rows, _HANDOFF_COLUMNS, origin, json_file)
    if chart_file is not None:
        handoff_bench.chart(rows, chart_file)


@click.command()
@_model_option
@click.option("--scenario", type=click.Choice(scenarios.NAMES), default="water_2d", show_default=True)
@click.option("--seed", type=int, default=hybrid_bench.Settings.seed, show_default=True)
@click.option("--frames", type=click.IntRange(60, 10_000), default=600, show_default=True)
@click.option("--r-c", type=click.FloatRange(-1, 1), default=0.8, show_default=True)
@click.option("--safeguard", type=click.Choice(get_args(Safeguard)), default="ours", show_default=True)
@click.option("--threads", type=click.IntRange(1, 1024), default=1, show_default=True)
@json_option
@chart_option
def hybrid(
    *,
    model: str | None,
    scenario: str,
    seed: int,
    frames: int,
    r_c: float,
    safeguard: Safeguard,
    threads: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Follow the error of one rollout: the network alone, the hybrid, and MPM with the same particles."""
    settings = hybrid_bench.Settings(
        model=model,
        scenario=scenario,
        seed=seed,
        frames=frames,
        r_c=r_c,
        safeguard=safeguard,
        threads=threads,
    )
    options = {"model": (model,), "scenario": (scenario,), "seed": (seed,), "frames": (frames,)}
    more = {"r-c": (r_c,), "safeguard": (safeguard,), "threads": (threads,)}
    origin = source("hybrid", **options, **more)
    with progress("Measuring", settings.methods) as bar:
        rows = list(hybrid_bench.rows(settings, origin, bar.update))
    if json_file is not None:
        write_rows(json_file, rows)
    if chart_file is not None:
        hybrid_bench.chart(rows, chart_file)
    report([row for row in rows if row["frame"] % _TOLD == 0], _HYBRID_COLUMNS, origin, None)

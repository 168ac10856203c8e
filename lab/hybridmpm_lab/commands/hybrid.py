"""`python -m hybridmpm_lab hybrid`: shares of the frames that networks simulate, and errors."""

from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.cli.options import model_option
from hybridmpm.cli.progress import progress
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    number_option,
    print_origin,
    print_table,
    runs_option,
    save,
    scenario_option,
    source,
)
from hybridmpm_lab.compare.accuracy.conventions import FIRST_SEED
from hybridmpm_lab.compare.hybrid import scenes as scenes_bench
from hybridmpm_lab.compare.hybrid import scenes_chart
from hybridmpm_lab.harness.store import RowStore

_SHARES_COLUMNS = (
    "scenario", "method", "show_all", "scenes", "network", "free_fall", "rest", "mpm", "contact", "ratio",
    "ratio_se", "worst", "nrmse", "to_free_fall", "kinetic_met", "ms_per_frame",
)  # fmt: skip
_PROMISE_COLUMNS = ("scenario", "show_all", "after", "bound", "held", "calibrated_on", "tested_on")


@click.command()
@model_option
@scenario_option("Scenario of the scenes.", default=scenarios.NAMES)
@number_option("--scenes", 1, 100_000, 20, "Number of scenes of each scenario.")
@number_option(
    "--promised", 0, 100_000, 0, "Number of scenes of each scenario that promises are made from, if more."
)
@click.option(
    "--first",
    type=click.IntRange(min=0),
    default=FIRST_SEED,
    show_default=True,
    help="Seed of the first scene; settings are chosen on seeds from 1000000 on, and judged on the default.",
)
@number_option("--frames", 100, 10_000, 400, "Number of frames of each scene.")
@click.option(
    "--method",
    "methods",
    type=click.Choice(scenes_bench.METHODS),
    multiple=True,
    default=scenes_bench.MAIN,
    show_default=True,
    help="Method to run. May be given several times.",
)
@click.option(
    "--show-all",
    "carried",
    type=click.Choice(["yes", "no", "both"]),
    default="yes",
    show_default=True,
    help="Whether all particles of the scene are carried along and compared.",
)
@runs_option
@json_option
@chart_option
def hybrid(
    *,
    model: str | None,
    names: tuple[str, ...],
    scenes: int,
    promised: int,
    first: int,
    frames: int,
    methods: tuple[str, ...],
    carried: str,
    runs_file: Path | None,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Measure on many scenes which share of the frames a hybrid's network simulates, and at what error.

    Errors are held against those of MPM with as few particles. A second table tells how many times MPM's
    error is not exceeded in 90 % of the scenes, and whether that holds in scenes that it was not taken from.
    """
    settings = scenes_bench.ScenesSettings(
        model=model,
        scenarios=names,
        first=first,
        scenes=scenes,
        promised=promised,
        frames=frames,
        methods=methods,
        carried={"yes": (True,), "no": (False,), "both": (True, False)}[carried],
    )
    options = {"model": (model,), "scenario": names, "scenes": (scenes,), "promised": (promised,)}
    more = {"first": (first,), "frames": (frames,), "method": methods, "show_all": (carried,)}
    origin = source("shares", **options, **more)
    runs = RowStore(settings.shared(), runs_file)
    with progress("Measuring", len(settings.asked_for())) as bar:
        rows = list(scenes_bench.measure(settings, runs, origin, bar.update))
    save(rows, json_file, chart_file, scenes_chart.chart)
    for part, columns in (("mean", _SHARES_COLUMNS), ("promise", _PROMISE_COLUMNS)):
        click.echo(f"\n{part}")
        if chosen := [row for row in rows if row["part"] == part]:
            print_table(chosen, columns)
    print_origin(origin)

"""`hybridmpm bench` on the hybrid simulator: safeguard, handoff, hybrid, shares."""

from functools import partial
from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.bench.accuracy.conventions import FIRST_SEED
from hybridmpm.bench.hybrid import handoff as handoff_bench
from hybridmpm.bench.hybrid import hybrid as hybrid_bench
from hybridmpm.bench.hybrid import safeguard as safeguard_bench
from hybridmpm.bench.hybrid import safeguard_chart, scenes_chart
from hybridmpm.bench.hybrid import scenes as scenes_bench
from hybridmpm.bench.report.gathered import Gathered
from hybridmpm.cli.bench.options import (
    chart_option,
    json_option,
    measured,
    number_option,
    print_origin,
    print_table,
    report,
    runs_option,
    save,
    scenario_option,
    source,
    threads_option,
)
from hybridmpm.cli.options import model_option, r_c_option, safeguard_option
from hybridmpm.cli.progress import progress
from hybridmpm.hybrid.guards import Safeguard

_PARTS = {
    "cost": ("scenario", "guard", "particles", "us_per_frame", "share_of_mpm"),
    "correlation": ("scenario", "guard", "spearman", "spearman_without_time", "points"),
    "delay": ("event", "scene", "guard", "impact", "delay", "alarms_before"),
    "false alarms": ("scene", "guard", "frames", "alarms"),
}
_HANDOFF_COLUMNS = (
    "material", "phase", "handoff", "kinetic_1", "kinetic_4", "kinetic_16", "grid_1", "grid_4", "grid_16",
    "acceleration", "acceleration_mpm",
)  # fmt: skip
_HYBRID_COLUMNS = ("scenario", "method", "ms_per_frame", "seconds", "mpm_share", "frame", "error")
_SHARES_COLUMNS = (
    "scenario", "method", "carry", "scenes", "network", "free_fall", "rest", "mpm", "contact", "ratio",
    "ratio_se", "worst", "nrmse", "to_free_fall", "kinetic_met", "ms_per_frame",
)  # fmt: skip
_PROMISE_COLUMNS = ("scenario", "carry", "after", "bound", "held", "calibrated_on", "tested_on")
_LINE_EVERY = 50
"""Frames between two lines of the table of a rollout."""


@click.command()
@model_option
@scenario_option("Scenario of the scenes.", default=scenarios.NAMES)
@number_option("--scenes", 1, 1000, 10, "Number of scenes of each scenario.")
@number_option("--frames", 60, 10_000, 200, "Number of frames of each scene.")
@json_option
@chart_option
def safeguard(
    *,
    model: str | None,
    names: tuple[str, ...],
    scenes: int,
    frames: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Measure the guards that watch a network.

    Four tables tell the time that each guard takes, the correlation of its value with the network's error,
    the frames from an impact to its first alarm, and its false alarms on a pool at rest.
    """
    settings = safeguard_bench.SafeguardSettings(model=model, scenarios=names, scenes=scenes, frames=frames)
    origin = source("safeguard", model=(model,), scenario=names, scenes=(scenes,), frames=(frames,))
    rows = measured(partial(safeguard_bench.measure, settings), settings.count, origin)
    save(rows, json_file, chart_file, safeguard_chart.chart)
    for part, columns in _PARTS.items():
        click.echo(f"\n{part}")
        print_table([row for row in rows if row["part"] == part], columns)
    print_origin(origin)


@click.command()
@json_option
@chart_option
def handoff(*, json_file: Path | None, chart_file: Path | None) -> None:
    """Measure the shock when MPM takes over from a network.

    Each way of handing over (warm, cold, shadow) is compared with MPM left undisturbed: in free fall, at
    the impact and at rest, for each material.
    """
    origin = source("handoff")
    rows = measured(handoff_bench.measure, handoff_bench.COUNT, origin)
    report(rows, _HANDOFF_COLUMNS, origin, json_file, chart_file=chart_file, draw=handoff_bench.chart)


@click.command()
@model_option
@click.option(
    "--scenario",
    type=click.Choice(scenarios.NAMES),
    default="water_2d",
    show_default=True,
    help="Scenario of the scene.",
)
@click.option(
    "--seed",
    type=int,
    default=hybrid_bench.HybridSettings.seed,
    show_default=True,
    help="Seed of the scene.",
)
@number_option("--frames", 60, 10_000, 600, "Number of frames.")
@r_c_option
@safeguard_option
@threads_option("Number of threads of every simulator.")
@json_option
@chart_option
def hybrid(
    *,
    model: str | None,
    scenario: str,
    seed: int,
    frames: int,
    r_c: float | None,
    safeguard: Safeguard,
    threads: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Follow the error of one hybrid rollout.

    Beside the hybrid simulator run the network alone, and MPM with the same particles.
    """
    settings = hybrid_bench.HybridSettings(
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
    rows = measured(partial(hybrid_bench.measure, settings), settings.count, origin)
    save(rows, json_file, chart_file, hybrid_bench.chart)
    print_table([row for row in rows if row["frame"] % _LINE_EVERY == 0], _HYBRID_COLUMNS)
    print_origin(origin)


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
    "--carry",
    "carried",
    type=click.Choice(["yes", "no", "both"]),
    default="yes",
    show_default=True,
    help="Whether all particles of the scene are carried along and compared.",
)
@runs_option
@json_option
@chart_option
def shares(
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
    more = {"first": (first,), "frames": (frames,), "method": methods, "carry": (carried,)}
    origin = source("shares", **options, **more)
    runs = Gathered(settings.shared(), runs_file)
    with progress("Measuring", len(settings.asked_for())) as bar:
        rows = list(scenes_bench.measure(settings, runs, origin, bar.update))
    save(rows, json_file, chart_file, scenes_chart.chart)
    for part, columns in (("mean", _SHARES_COLUMNS), ("promise", _PROMISE_COLUMNS)):
        click.echo(f"\n{part}")
        if chosen := [row for row in rows if row["part"] == part]:
            print_table(chosen, columns)
    print_origin(origin)

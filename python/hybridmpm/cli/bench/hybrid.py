"""`hybridmpm bench` on the hybrid simulator: safeguard, handoff, hybrid."""

from functools import partial
from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.bench.hybrid import handoff as handoff_bench
from hybridmpm.bench.hybrid import hybrid as hybrid_bench
from hybridmpm.bench.hybrid import safeguard as safeguard_bench
from hybridmpm.bench.hybrid import safeguard_chart
from hybridmpm.cli.bench.options import (
    chart_option,
    json_option,
    measured,
    number_option,
    print_origin,
    print_table,
    report,
    save,
    scenario_option,
    source,
    threads_option,
)
from hybridmpm.cli.options import model_option, r_c_option, safeguard_option
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
_LINE_EVERY = 50
"""Frames between two lines of the table of a rollout."""


@click.command()
@model_option
@scenario_option("Scenario of the scenes.", default=scenarios.NAMES)
@number_option("--scenes", 1, 1000, 3, "Number of scenes of each scenario.")
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
    r_c: float,
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

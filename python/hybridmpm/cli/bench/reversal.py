"""`hybridmpm bench reversal`: reversed cases of control."""

from functools import partial
from pathlib import Path

import click

from hybridmpm.bench.reversal import reversal as reversal_bench
from hybridmpm.cli.bench.options import (
    chart_option,
    json_option,
    measured,
    number_option,
    print_origin,
    print_table,
    save,
    scenario_option,
    source,
)

_COLUMNS = (
    "scenario",
    "start",
    "cap",
    "error",
    "error_se",
    "share_good",
    "worst",
    "worst_seed",
    "peak",
    "rms",
)
_CASE_COLUMNS = (
    "scenario", "start", "error", "error_smoothed", "error_unforced", "cosine", "cosine_smoothed", "seconds",
)  # fmt: skip


@click.command()
@scenario_option("Scenario of the scenes.", default=reversal_bench.SCENARIOS)
@number_option("--seeds", 1, 10_000, 24, "Number of seeds of each scenario, from 1.1 * 10^6 on.")
@number_option("--frames", 2, 5000, 100, "Frames of control.")
@json_option
@chart_option
def reversal(
    *,
    names: tuple[str, ...],
    seeds: int,
    frames: int,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Measure how well reversed control data lead back to where the fluid was.

    The first table tells the error at the end for each cap of the force, the second what the paper's
    smoothing does to forces and error at 30 g.
    """
    settings = reversal_bench.ReversalSettings(scenarios=names, seeds=seeds, frames=frames)
    origin = source("reversal", scenario=names, seeds=(seeds,), frames=(frames,))
    rows = measured(partial(reversal_bench.measure, settings), settings.count, origin)
    save(rows, json_file, chart_file, reversal_bench.chart)
    errors = [row for row in rows if row["part"] == "error"]
    print_table(errors, _COLUMNS)
    click.echo()
    print_table([row for row in errors if row["cap"] == reversal_bench.CAP], _CASE_COLUMNS)
    print_origin(origin)

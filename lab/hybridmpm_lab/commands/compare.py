"""The comparisons `tradeoff`, `coarse`, `models` and `hybrid`, and `plan-errors`."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm._support.machine import usable_cores
from hybridmpm.cli.progress import progress
from hybridmpm.errors import ConfigError
from hybridmpm_lab.commands.options import Measurement, number_option, runs_option
from hybridmpm_lab.compare import chart, comparison, lists
from hybridmpm_lab.compare import hybrid as hybrids
from hybridmpm_lab.compare import plan_errors as errors_of_plans
from hybridmpm_lab.compare.comparison import Case
from hybridmpm_lab.harness.provenance import Provenance, read_rows
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.harness.timing import QUIET
from hybridmpm_lab.speed.baselines import require_installed

_COLUMNS = (
    "scenario", "method", "label", "ms_per_frame", "ms_p95", "error", "error_se", "error_40", "error_100",
    "error_200", "transport", "mpm_share", "failed", "on_front", "dominated_by", "equal_mpm_ms",
)  # fmt: skip
_HYBRID_COLUMNS = (
    "part", "scenario", "method", "label", "scenes", "mpm_share", "network", "free_fall", "rest", "contact",
    "ratio", "ratio_se", "worst",
)  # fmt: skip


_OPTIONS = (
    runs_option,
    number_option("--jobs", 1, 1024, usable_cores(), "Processes for the errors; times are taken by one."),
    number_option("--passes", 1, 1000, 9, "Timings of each piece; their lower quartile counts."),
    click.option(
        "--only",
        type=click.Choice(["errors", "times", "table"]),
        help="Do this part alone. Errors may be measured on a busy machine, times need an idle one; the "
        "table is made of the rows in the file of --runs.",
    ),
)


def _command(
    *,
    cases: Callable[[Any], list[Case]],
    columns: Sequence[str] = _COLUMNS,
    table: Callable[[Sequence[Case], RowStore], list[Row]] = comparison.table,
    draw: Callable[[Sequence[Row], Path], object] = chart.chart,
    is_timed: bool = True,
    **named: Any,
) -> click.Command:
    """Return the command of a comparison of methods on the scenes of cases."""

    def measure(
        settings: comparison.ComparisonSettings,
        origin: Provenance,
        *,
        only: str | None,
        passes: int,
        jobs: int,
        runs_file: Path | None,
    ) -> list[Row]:
        if only == "table" and runs_file is None:
            raise ConfigError(
                "--only table makes the table of runs that are there: name their file by --runs"
            )
        for peer in getattr(settings, "peer", ()):
            require_installed(peer)
        found, store = cases(settings), RowStore(settings.shared(), runs_file)
        if only in (None, "errors"):
            with progress("Errors", sum(len(case.seeds) for case in found)) as bar:
                comparison.measure_errors(found, store, origin, jobs, bar.update)
        if only in (None, "times") and is_timed:
            with progress("Times", len(found)) as bar:
                comparison.measure_times(found, store, origin, passes, bar.update)
        rows = table(found, store)
        if not rows:
            raise ConfigError(f"{runs_file} has no runs of these cases; measure them first")
        if busy := {str(row["scenario"]) for row in rows if (row.get("slowdown") or 0) > QUIET}:
            click.echo(f"The machine was busy while these were timed, so time them again: {', '.join(busy)}")
        return rows

    return Measurement(measure=measure, columns=columns, draw=draw, options=_OPTIONS, **named).command()


tradeoff = _command(
    name="tradeoff",
    settings=lists.TradeoffSettings,
    cases=lists.tradeoff,
    summary="""Compare all methods by error and time.

    Methods are MPM in full and with fewer particles, alone, showing all and fitted; softer; each
    network of the library, and hybrids with it. Errors are taken against the truth in scenes that no data set
    and no fit contains. Methods that another one beats in both are dominated, all others are the Pareto
    front. equal_mpm_ms is the time of the quickest MPM that errs no more: a network pays only below it.
    """,
)
coarse = _command(
    name="coarse",
    settings=lists.CoarseSettings,
    cases=lists.coarse,
    summary="""Compare MPM with fewer particles by error and time: alone, showing all, and fitted.

    Beside them stand the floors of the error (jitter: the truth with other jitter; merged: the truth shown by
    as few particles) and its ceiling (still: the initial state held).
    """,
)
models = _command(
    name="models",
    settings=lists.ModelsSettings,
    cases=lists.models,
    summary="""Compare networks by error and time, beside MPM and free fall.

    equal_mpm_ms is the time of the quickest MPM that errs no more: a network pays only below it.
    """,
)
hybrid = _command(
    name="hybrid",
    settings=hybrids.HybridSettings,
    cases=hybrids.cases,
    summary="""Measure the share of the frames that a hybrid's network simulates, and its error over MPM's.

    MPM has as few particles. Rows of the part "bound" are ratios that are not exceeded in 90 % of the scenes,
    and the share of other scenes in which that held.
    """,
    columns=_HYBRID_COLUMNS,
    table=hybrids.table,
    draw=hybrids.chart,
    is_timed=False,
)


@click.command("plan-errors")
@click.argument("rows_file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("calibration", type=click.Path(dir_okay=False, path_type=Path))
def plan_errors(*, rows_file: Path, calibration: Path) -> None:
    """Write the errors of ROWS_FILE, made by `tradeoff --json`, with the shipped times into CALIBRATION."""
    errors_of_plans.refresh(calibration, read_rows(rows_file))
    click.echo(f"wrote {calibration}")

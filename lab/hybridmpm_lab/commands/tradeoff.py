"""`python -m hybridmpm_lab tradeoff`."""

from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm._support.machine import usable_cores
from hybridmpm.cli.devices import require_torch
from hybridmpm.cli.progress import progress
from hybridmpm.errors import ConfigError
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    number_option,
    only_option,
    pattern_option,
    report,
    runs_option,
    scenario_option,
    source,
    threads_option,
)
from hybridmpm_lab.compare.tradeoff import chart as drawing
from hybridmpm_lab.compare.tradeoff import errors, sheet, times
from hybridmpm_lab.compare.tradeoff.settings import TradeoffSettings
from hybridmpm_lab.compare.tradeoff.table import table
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.speed.baselines.loading import SOLVERS, check_peer

_COLUMNS = (
    "scenario", "method", "label", "threads", "ms_per_frame", "ms_p95", "ms_mean", "error", "error_se",
    "error_40", "error_100", "error_200", "transport", "kinetic_energy", "centroid", "density", "mpm_share",
    "failed", "on_front", "dominated_by", "as_good_ms",
)  # fmt: skip


@click.command()
@scenario_option("Scenario of the scenes.", default=scenarios.NAMES)
@number_option("--scenes", 1, 1000, TradeoffSettings.scenes, "Number of held-out scenes of each scenario.")
@number_option("--span", 40, 10_000, TradeoffSettings.span, "Number of frames that count, and are timed.")
@number_option("--passes", 1, 1000, TradeoffSettings.passes, "Timings of each frame; lower quartile counts.")
@threads_option("Number of threads of every simulator of ours.")
@click.option(
    "--peer",
    "peers",
    type=click.Choice(SOLVERS),
    multiple=True,
    help="Measure this solver of others, too, in scenes that it takes. May be given several times.",
)
@click.option("--paper", is_flag=True, help="Time networks of the paper's size, too. This needs torch.")
@pattern_option
@only_option
@runs_option
@number_option("--jobs", 1, 1024, usable_cores(), "Processes for the errors; times are taken by one.")
@click.option(
    "--sheet",
    "sheet_file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write a contact sheet of all scenarios into this PNG, too.",
)
@json_option
@chart_option
def tradeoff(
    *,
    names: tuple[str, ...],
    scenes: int,
    span: int,
    passes: int,
    threads: int,
    peers: tuple[str, ...],
    paper: bool,
    patterns: tuple[str, ...],
    only: str | None,
    runs_file: Path | None,
    jobs: int,
    sheet_file: Path | None,
    json_file: Path | None,
    chart_file: Path | None,
) -> None:
    """Hold every method against every other: error and time.

    Methods are MPM in full and with fewer particles, alone, carrying all others and fitted; softer, sleeping;
    each network of the library, and hybrids with it. Errors are taken against the truth in scenes that no
    data set and no fit contains. Points that another one beats in both are dominated, all others are the
    front. as_good_ms is the time of the quickest MPM that errs no more: a network pays only below it.
    """
    settings = TradeoffSettings(
        scenarios=names, scenes=scenes, span=span, passes=passes, threads=threads, peers=peers,
        patterns=patterns,
    )  # fmt: skip
    for peer in peers:
        check_peer(peer, known=SOLVERS)
    if only == "table" and runs_file is None:
        raise ConfigError("--only table makes the table of runs that are there: name their file by --runs")
    options = {"scenario": names, "scenes": (scenes,), "span": (span,), "passes": (passes,)}
    more = {"threads": (threads,), "peer": peers, "entrant": patterns}
    origin = source("tradeoff", **options, **more)
    runs = RowStore(settings.shared(), runs_file)
    _measure(settings, runs, origin, only=only, paper=paper, jobs=jobs)
    rows = table(settings, runs)
    if not rows:
        raise ConfigError(f"{runs_file} holds no runs of these scenarios; measure them first")
    if sheet_file is not None:
        with progress("Drawing", len(names)) as bar:
            sheet.write_sheet(sheet_file, names, threads, bar.update)
    report(rows, _COLUMNS, origin, json_file, chart_file=chart_file, draw=drawing.chart)
    _tell_load(rows)


def _measure(
    settings: TradeoffSettings,
    runs: RowStore,
    origin: Provenance,
    *,
    only: str | None,
    paper: bool,
    jobs: int,
) -> None:
    if only in (None, "errors"):
        with progress("Errors", settings.scenes * len(settings.scenarios)) as bar:
            errors.measure_errors(settings, runs, origin, bar.update, jobs)
    if only in (None, "times"):
        with progress("Times", len(settings.scenarios)) as bar:
            times.measure_times(settings, runs, origin, bar.update)
        if paper:
            require_torch()
            from hybridmpm_lab.compare.tradeoff.paper import measure_paper  # noqa: PLC0415 - needs torch

            with progress("Networks of the paper", len(settings.scenarios)) as bar:
                measure_paper(settings, runs, origin, bar.update)


def _tell_load(rows: list[dict[str, object]]) -> None:
    """Say in which scenarios the machine had other work while times were taken."""
    slow = {
        str(row["scenario"])
        for row in rows
        if isinstance(row["slowdown"], float) and row["slowdown"] > times.QUIET
    }
    if slow:
        click.echo(
            f"The machine was busy while these were timed, so time them again: {', '.join(sorted(slow))}"
        )

"""`python -m hybridmpm_lab stability`."""

from dataclasses import dataclass
from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    print_origin,
    print_table,
    runs_option,
    save,
)
from hybridmpm_lab.harness.settings import origin_of, setting, settings_options
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.stability import chart
from hybridmpm_lab.stability import map as stability_map
from hybridmpm_lab.stability.stresses import STRESSES


@dataclass(frozen=True)
class _Settings:
    stress: tuple[str, ...] = setting((), "Stress of the map; all if absent.", tuple(STRESSES))


@click.command()
@settings_options(_Settings)
@runs_option
@json_option
@chart_option
def stability(
    settings: _Settings, runs_file: Path | None, json_file: Path | None, chart_file: Path | None
) -> None:
    """Find the scenes that each method survives.

    MPM, the coarse mode, the network and the hybrid run under each stress at three levels. A letter for each
    level shows the outcome; an exclamation mark follows where the user gets no signal.
    """
    todo = stability_map.cells(settings.stress)
    origin = origin_of("stability", settings)
    runs = RowStore({}, runs_file)
    with progress("Measuring", len(todo)) as bar:
        rows = list(stability_map.measure(todo, runs, origin, bar.update))
    save(rows, json_file, chart_file, chart.draw)
    lines: dict[tuple[str, str], dict[str, str]] = {}
    for row in rows:
        line = lines.setdefault(
            (row["stress"], f"{row['material']} {row['dim']}D"), dict.fromkeys(chart.TITLES, "")
        )
        silent = row["outcome"] in ("degraded", "failed") and not row["signalled"]
        line[row["method"]] += chart.SIGNS[row["outcome"]] + "!" * silent
    table = [{"stress": stress, "setting": setting} | line for (stress, setting), line in lines.items()]
    print_table(table, ("stress", "setting", *chart.TITLES))
    click.echo(". survived, x refused, d degraded, F failed, ! without a signal to the user\n")
    print_table(stability_map.counted(rows), ("method", *chart.SIGNS, "silent"))
    print_origin(origin)

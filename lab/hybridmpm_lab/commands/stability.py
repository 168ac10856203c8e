"""`python -m hybridmpm_lab stability`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.commands.options import Measurement, runs_option
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.harness.settings import setting
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.harness.table import print_table
from hybridmpm_lab.stability import chart
from hybridmpm_lab.stability import map as stability_map
from hybridmpm_lab.stability.stresses import STRESSES


@dataclass(frozen=True)
class _Settings:
    stress: tuple[str, ...] = setting((), "Stress of the map; all if absent.", tuple(STRESSES))


def _measure(settings: _Settings, origin: Provenance, runs_file: Path | None) -> list[Row]:
    todo = stability_map.cells(settings.stress)
    with progress("Measuring", len(todo)) as bar:
        return list(stability_map.measure(todo, RowStore({}, runs_file), origin, bar.update))


def _show(rows: Sequence[Row]) -> None:
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


stability = Measurement(
    name="stability",
    settings=_Settings,
    measure=_measure,
    draw=chart.draw,
    show=_show,
    options=(runs_option,),
    summary="""Find the scenes that each method survives.

    MPM, the coarse mode, the network and the hybrid run under each stress at three levels. A letter for each
    level shows the outcome; an exclamation mark follows where the user gets no signal.
    """,
).command()

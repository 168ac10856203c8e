"""`python -m hybridmpm_lab control`."""

from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.commands.options import Measurement, runs_option
from hybridmpm_lab.control.chart import chart
from hybridmpm_lab.control.runner import ControlSettings, count_missing, measure, rows_of, run_store
from hybridmpm_lab.control.sheets import sheets, write_sheets
from hybridmpm_lab.control.table import aims_table, compared_with_aims, means, tables
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Row


def _measure(
    settings: ControlSettings, origin: Provenance, runs_file: Path | None, folder: Path | None
) -> list[Row]:
    some, methods, store = settings.cases, settings.methods, run_store(runs_file)
    with progress("Measuring", count_missing(settings, store)) as bar:
        measure(settings, store, origin, bar.update)
    runs = rows_of(some, methods, store)
    if folder is not None:
        lines = sheets(some, runs)
        with progress("Drawing", sum(map(len, lines.values()))) as bar:
            write_sheets(folder, lines, methods, bar.update)
    click.echo(aims_table(compared_with_aims(runs)))
    return means(store, some, methods)


control = Measurement(
    name="control",
    settings=ControlSettings,
    measure=_measure,
    draw=chart,
    show=lambda rows: click.echo(tables(rows)),
    options=(
        click.option(
            "--sheets",
            "folder",
            type=click.Path(exists=True, file_okay=False, path_type=Path),
            metavar="FOLDER",
            help="Draw contact sheets into this folder: control-FAMILY.png, and control-worst.png of the "
            "sketches that analytic follows worst. These sketches run again.",
        ),
        runs_option,
    ),
    summary="""Compare methods of control on a fixed suite of sketches.

    The families are: states that are led back to where they came from (reversed), free ovals, bent arrows,
    ovals behind obstacles, fluid in pieces that is to be gathered, and ovals and arrows as a hand draws them.
    With --runs an interrupted command is resumed.
    """,
).command()

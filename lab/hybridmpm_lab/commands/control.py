"""`python -m hybridmpm_lab control`."""

from pathlib import Path

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.commands.options import chart_option, json_option, print_origin, runs_option, save
from hybridmpm_lab.control.chart import chart
from hybridmpm_lab.control.runner import ControlSettings, count_missing, measure, rows_of, run_store
from hybridmpm_lab.control.sheets import sheets, write_sheets
from hybridmpm_lab.control.table import compared_with_aims, means, tables
from hybridmpm_lab.harness.settings import origin_of, settings_options


@click.command()
@settings_options(ControlSettings)
@runs_option
@json_option
@chart_option
@click.option(
    "--sheets",
    "folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Draw contact sheets into this folder: control-FAMILY.png, and control-worst.png of the sketches "
    "that analytic follows worst. These sketches run again.",
)
def control(
    settings: ControlSettings,
    runs_file: Path | None,
    json_file: Path | None,
    chart_file: Path | None,
    folder: Path | None,
) -> None:
    """Compare methods of control on a fixed suite of sketches.

    The families are: states that are led back to where they came from (reversed), free ovals, bent arrows,
    ovals behind obstacles, fluid in pieces that is to be gathered, and ovals and arrows as a hand draws them.
    With --runs an interrupted command is resumed.
    """
    origin = origin_of("control", settings)
    some, methods, store = settings.cases, settings.methods, run_store(runs_file)
    with progress("Measuring", count_missing(settings, store)) as bar:
        measure(settings, store, origin, bar.update)
    rows, runs = means(store, some, methods), rows_of(some, methods, store)
    save(rows, json_file, chart_file, chart)
    click.echo(tables(rows, compared_with_aims(runs)))
    if folder is not None:
        lines = sheets(some, runs)
        with progress("Drawing", sum(map(len, lines.values()))) as bar:
            write_sheets(folder, lines, methods, bar.update)
    print_origin(origin)

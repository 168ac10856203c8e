"""`python -m hybridmpm_lab control`."""

from pathlib import Path

import click

from hybridmpm import scenarios
from hybridmpm.cli.progress import progress
from hybridmpm.errors import ConfigError
from hybridmpm_lab.commands.options import (
    chart_option,
    json_option,
    print_origin,
    runs_option,
    save,
    scenario_option,
    source,
)
from hybridmpm_lab.control.chart import chart
from hybridmpm_lab.control.methods import NAMES, methods_of
from hybridmpm_lab.control.runner import count_missing, measure, rows_of, settings
from hybridmpm_lab.control.sheets import sheets, write_sheets
from hybridmpm_lab.control.suite import FAMILIES, cases
from hybridmpm_lab.control.table import compared_with_aims, means, tables
from hybridmpm_lab.harness.store import RowStore


@click.command()
@click.option(
    "--family",
    "families",
    type=click.Choice(FAMILIES),
    multiple=True,
    default=FAMILIES,
    help="Family of the sketches. May be given several times. Default: all.",
)
@scenario_option("Scenario of the scenes.", default=scenarios.NAMES)
@click.option(
    "--seeds",
    type=click.IntRange(1, 50),
    help="Largest number of sketches of each kind in each family and scenario. Default: all, up to 50.",
)
@click.option(
    "--method",
    "names_of_methods",
    multiple=True,
    default=NAMES,
    show_default=True,
    metavar="METHOD",
    help="A method, or MODULE:ATTRIBUTE for one of your own. May be given several times. The constant force "
    "always takes part, because the others are compared with it.",
)
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
    *,
    families: tuple[str, ...],
    names: tuple[str, ...],
    seeds: int | None,
    names_of_methods: tuple[str, ...],
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
    some = cases(families, names, seeds)
    if not some:
        raise ConfigError(
            f"the families {', '.join(families)} have no sketches in {', '.join(names)}: bent and gather "
            "leave out ramps, reversed has water and sand in 2D and 3D"
        )
    methods = methods_of(names_of_methods)
    origin = source(
        "control",
        family=families if families != FAMILIES else (),
        scenario=names if names != scenarios.NAMES else (),
        seeds=(seeds,),
        method=names_of_methods if names_of_methods != NAMES else (),
    )
    store = RowStore(settings(), runs_file)
    with progress("Measuring", count_missing(some, methods, store)) as bar:
        measure(some, methods, store, origin, bar.update)
    rows = means(store, some, methods)
    runs = rows_of(some, methods, store)
    save(rows, json_file, chart_file, chart)
    click.echo(tables(rows, compared_with_aims(runs)))
    if folder is not None:
        lines = sheets(some, runs)
        with progress("Drawing", sum(map(len, lines.values()))) as bar:
            write_sheets(folder, lines, methods, bar.update)
    print_origin(origin)

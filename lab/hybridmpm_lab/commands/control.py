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
    print_table,
    runs_option,
    save,
    scenario_option,
    source,
)
from hybridmpm_lab.control.entrants import CONSTANT, NAMES, entrant
from hybridmpm_lab.control.report.aims import compared_with_aims, compared_with_paper
from hybridmpm_lab.control.report.chart import chart
from hybridmpm_lab.control.report.means import means
from hybridmpm_lab.control.report.page import check_page, fill_page
from hybridmpm_lab.control.report.sheets import sheets, write_sheets
from hybridmpm_lab.control.results import Runs
from hybridmpm_lab.control.runner import ControlSettings, count_missing, measure
from hybridmpm_lab.control.suite.cases import FAMILIES, cases
from hybridmpm_lab.harness.rows import Row

_COLUMNS = (
    "scenario", "sketch", "method", "count", "failed", "error", "error_gap", "transport", "transport_gap",
    "wins", "inside", "inside_later", "centroid_error", "direction_error", "path_error", "path_error_gap",
    "rms_ratio", "peak_ratio", "fine_share", "density_ratio", "naturalness", "plan_ms", "first_frame_ms",
    "total_ms", "slowdown",
)  # fmt: skip
_AIM_COLUMNS = ("scenario", "sketch", "bodies", "method", "count", "aim", "measured", "se", "met")
_PAPER_COLUMNS = (
    "scenario", "sketch", "paper_baseline", "paper_learned", "paper_ratio", "best", "nrmse_constant",
    "nrmse_best", "nrmse_ratio", "node_error_constant", "node_error_best", "node_error_ratio", "error_ratio",
)  # fmt: skip


@click.command()
@click.option(
    "--family",
    "families",
    type=click.Choice(FAMILIES),
    multiple=True,
    default=FAMILIES,
    show_default=True,
    help="Family of the sketches. May be given several times.",
)
@scenario_option("Scenario of the scenes.", default=scenarios.NAMES)
@click.option(
    "--seeds",
    type=click.IntRange(1, 50),
    help="Number of sketches of each kind in each family and scenario. If absent, all: 50 of the reversed "
    "family, 10 of the others.",
)
@click.option(
    "--method",
    "methods",
    multiple=True,
    default=NAMES,
    show_default=True,
    metavar="METHOD",
    help="A method of the library, or MODULE:ATTRIBUTE for one of your own. May be given several times. The "
    "constant force always takes part, because the others are held against it.",
)
@runs_option
@json_option
@chart_option
@click.option(
    "--sheets",
    "sheets_folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Write contact sheets into this folder: control-FAMILY.png of one sketch of each kind, and "
    "control-worst.png of those that analytic follows worst. That runs these sketches again.",
)
@click.option(
    "--page",
    "page_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write the tables into this Markdown file, between its marks, as into docs/results/control.md.",
)
def control(
    *,
    families: tuple[str, ...],
    names: tuple[str, ...],
    seeds: int | None,
    methods: tuple[str, ...],
    runs_file: Path | None,
    json_file: Path | None,
    chart_file: Path | None,
    sheets_folder: Path | None,
    page_file: Path | None,
) -> None:
    """Hold methods of control against each other on a fixed suite of sketches.

    Six families: states that are led back to where they came from (reversed), free ovals, bent arrows, ovals
    behind obstacles, fluid in pieces that is to be gathered, and ovals and arrows as a hand draws them.
    docs/results/control.md tells what each can show, and how to enter a method of your own. With --runs an
    interrupted benchmark goes on where it stopped.
    """
    if page_file is not None:
        check_page(page_file)
    some = cases(families, names, seeds)
    if not some:
        raise ConfigError(
            f"the families {', '.join(families)} have no sketches in {', '.join(names)}: bent and gather "
            "leave out ramps, reversed has water and sand in 2D and 3D"
        )
    entrants = [
        entrant(name) for name in dict.fromkeys(methods if CONSTANT in methods else (CONSTANT, *methods))
    ]
    settings = ControlSettings(cases=some, entrants=entrants)
    origin = source(
        "control",
        family=families if families != FAMILIES else (),
        scenario=names if names != scenarios.NAMES else (),
        seeds=(seeds,),
        method=methods if methods != NAMES else (),
    )
    runs = Runs(settings.shared(), runs_file)
    with progress("Measuring", count_missing(settings, runs)) as bar:
        measure(settings, runs, origin, bar.update)
    rows = means(runs, some, entrants)
    save(rows, json_file, chart_file, chart)
    for family in dict.fromkeys(row["family"] for row in rows):
        click.echo(f"\n{family}")
        _print_means([row for row in rows if row["family"] == family])
    aims = compared_with_aims(runs.rows(some, (one.name for one in entrants)))
    _print_part("aims", aims, _AIM_COLUMNS)
    _print_part("beside the paper", compared_with_paper(rows), _PAPER_COLUMNS)
    if page_file is not None:
        fill_page(page_file, rows, aims)
    if sheets_folder is not None:
        lines = sheets(some, runs.rows(some, [one.name for one in entrants]))
        with progress("Drawing", sum(map(len, lines.values()))) as bar:
            write_sheets(sheets_folder, lines, entrants, on_progress=bar.update)
    print_origin(origin)


def _print_part(title: str, rows: list[Row], columns: tuple[str, ...]) -> None:
    if rows:
        click.echo(f"\n{title}")
        print_table(rows, columns)


def _print_means(rows: list[Row]) -> None:
    """Print the means of a family, and paired standard errors of the differences to the constant force.

    Columns that hold nothing, such as that of failures where there is none, are left out.
    """
    shown = [column for column in _COLUMNS if any(row[column] for row in rows)]
    print_table([{column: _cell(row, column) for column in shown} for row in rows], shown)


def _cell(row: Row, column: str) -> object:
    value = row[column]
    if value is None:
        return "-"
    if not column.endswith("_gap"):
        return f"{value:.3g}" if isinstance(value, float) else value
    spread = row[f"{column}_se"]
    return f"{value:+.3f}" if spread is None else f"{value:+.3f}±{spread:.3f}"

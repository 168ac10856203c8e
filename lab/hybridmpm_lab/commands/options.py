"""Options that all commands share, and the output of rows."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.provenance import Provenance, write_rows
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.table import print_table

__all__ = ["print_table"]


def _file_option(name: str, target: str, check: Callable[..., Path | None], text: str) -> Callable[..., Any]:
    kind = click.Path(dir_okay=False, path_type=Path)
    return click.option(name, target, type=kind, metavar="FILE", callback=check, help=text)


def _in_a_folder(_context: click.Context, option: click.Parameter, file: Path | None) -> Path | None:
    if file is not None and not file.parent.is_dir():
        raise click.UsageError(f"{option.opts[0]}: the folder {file.parent} does not exist.")
    return file


def _drawable(context: click.Context, option: click.Parameter, file: Path | None) -> Path | None:
    if file is not None:
        charts.panels()  # Without matplotlib the error comes here, not after the measurement.
    return _in_a_folder(context, option, file)


json_option = _file_option("--json", "json_file", _in_a_folder, "Write the rows to this JSON file, too.")
chart_option = _file_option("--chart", "chart_file", _drawable, "Draw the rows into this file.")
runs_option = _file_option(
    "--runs",
    "runs_file",
    _in_a_folder,
    "File to which runs are appended; the same command resumes with it after an interruption.",
)


def number_option(name: str, low: int, high: int, default: int, text: str) -> Callable[..., Any]:
    """Return an option for one whole number."""
    return click.option(name, type=click.IntRange(low, high), default=default, show_default=True, help=text)


def measured(measure: Callable[[Progress], Iterable[Row]], steps: int, origin: Provenance) -> list[Row]:
    """Run a measurement behind a progress bar of so many steps, and return its rows with their origin."""
    with progress("Measuring", steps) as bar:
        return [origin.stamped(row) for row in measure(bar.update)]


def save(
    rows: Sequence[Row],
    json_file: Path | None,
    chart_file: Path | None = None,
    draw: Callable[[Sequence[Row], Path], object] | None = None,
) -> None:
    """Write and draw the rows where files are given."""
    if json_file is not None:
        write_rows(json_file, rows)
    if chart_file is not None and draw is not None:
        draw(rows, chart_file)


def report(
    rows: Sequence[Row],
    columns: Sequence[str],
    origin: Provenance,
    json_file: Path | None,
    *,
    chart_file: Path | None = None,
    draw: Callable[[Sequence[Row], Path], object] | None = None,
) -> None:
    """Save the rows, and print some of their columns and their origin."""
    save(rows, json_file, chart_file, draw)
    print_table(rows, columns)
    print_origin(origin)


def print_origin(origin: Provenance) -> None:
    """Print machine, date and commit of the rows."""
    click.echo(f"{origin.machine}, {origin.date}, commit {origin.commit or 'unknown'}")

"""A measurement as a command: its options, the progress, and the output of its rows."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from hybridmpm.cli.progress import progress
from hybridmpm_lab.harness.provenance import Provenance, read_rows, write_rows
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.settings import origin_of, settings_options
from hybridmpm_lab.harness.table import print_table

Option = Callable[[Callable[..., Any]], Callable[..., Any]]


def _in_a_folder(_context: click.Context, option: click.Parameter, file: Path | None) -> Path | None:
    if file is not None and not file.parent.is_dir():
        raise click.UsageError(f"{option.opts[0]}: the folder {file.parent} does not exist.")
    return file


def file_option(name: str, text: str, *, exists: bool = False) -> Option:
    """Return an option for a file, as the argument `..._file`."""
    kind = click.Path(exists=exists, dir_okay=False, path_type=Path)
    return click.option(
        f"--{name}", f"{name}_file", type=kind, metavar="FILE", callback=_in_a_folder, help=text
    )


def number_option(name: str, low: int, high: int, default: int, text: str) -> Option:
    """Return an option for one whole number."""
    return click.option(name, type=click.IntRange(low, high), default=default, show_default=True, help=text)


runs_option = file_option(
    "runs", "File to which runs are appended; the same command resumes with it after an interruption."
)


def measured(measure: Callable[[Progress], Iterable[Row]], steps: int, origin: Provenance) -> list[Row]:
    """Run a measurement behind a progress bar of so many steps, and return its rows with their origin."""
    with progress("Measuring", steps) as bar:
        return [origin.stamped(row) for row in measure(bar.update)]


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A measurement whose rows are printed, written and drawn."""

    name: str
    summary: str
    """Help of the command."""
    settings: type[Any]
    measure: Callable[..., list[Row]]
    """Function of the settings, the origin and the further options that returns the rows."""
    columns: Sequence[str] = ()
    """Fields of the rows that are printed."""
    draw: Callable[[Sequence[Row], Path], object] | None = None
    show: Callable[[Sequence[Row]], object] | None = None
    """Prints the rows in place of a table of `columns`."""
    options: Sequence[Option] = ()
    """Further options."""

    def command(self) -> click.Command:
        """Return the command."""

        @settings_options(self.settings)
        @file_option(
            "rows", "Print and draw the rows of this file of --json, and measure nothing.", exists=True
        )
        @file_option("json", "Write the rows to this JSON file, too.")
        def run(
            *,
            settings: Any,
            rows_file: Path | None,
            json_file: Path | None,
            chart_file: Path | None = None,
            **more: Any,
        ) -> None:
            if rows_file is None:
                rows = self.measure(settings, origin_of(self.name, settings), **more)
            else:
                rows = read_rows(rows_file)
            if json_file is not None:
                write_rows(json_file, rows)
            if chart_file is not None and self.draw is not None:
                self.draw(rows, chart_file)
            if self.show is None:
                known = [name for name in self.columns if any(row.get(name) is not None for row in rows)]
                print_table(rows, known)
            else:
                self.show(rows)
            origin = rows[0]
            click.echo(f"{origin['machine']}, {origin['date']}, commit {origin['commit'] or 'unknown'}")

        run.__doc__ = self.summary
        called: Callable[..., Any] = run
        if self.draw is not None:
            called = file_option("chart", "Draw the rows into this file.")(called)
        for option in self.options:
            called = option(called)
        return click.command(self.name)(called)

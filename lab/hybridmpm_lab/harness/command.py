"""A measurement as a command: its settings, which are its options, and the output of its rows."""

import dataclasses
import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from hybridmpm import scenarios
from hybridmpm.cli.progress import progress
from hybridmpm_lab.harness.provenance import Provenance, provenance
from hybridmpm_lab.harness.rows import Progress, Row, print_table, read_rows, write_rows


def setting(
    default: Any, text: str, kind: Any = None, low: float | None = None, high: float | None = None
) -> Any:
    """Return the field of a settings class that is an option of a command, too, with `text` as its help.

    An option with a tuple as default may be given several times. `kind` is the type of a value, or a sequence
    of choices; without it, values are whole numbers between `low` and `high`.
    """
    if kind is None and low is not None:
        kind = click.IntRange(int(low), None if high is None else int(high))
    elif isinstance(kind, (list, tuple)):
        kind = click.Choice(kind)
    return dataclasses.field(default=default, metadata={"text": text, "kind": kind})


def scenarios_setting(default: tuple[str, ...] = scenarios.NAMES) -> Any:
    """Return the field of the scenarios of the scenes."""
    return setting(default, "Scenario of the scenes.", scenarios.NAMES)


def settings_options(settings: type[Any]) -> list[click.Parameter]:
    """Return the options of a settings class; `scenario: tuple[str, ...]` becomes `--scenario`."""
    options: list[click.Parameter] = []
    for one in dataclasses.fields(settings):
        several, text = isinstance(one.default, tuple), one.metadata["text"]
        options.append(
            click.Option(
                [_option(one.name)],
                type=one.metadata["kind"],
                multiple=several,
                default=one.default,
                show_default=one.default not in ((), None),
                help=text + (" May be given several times." if several else ""),
            )
        )
    return options


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def origin_of(command: str, settings: Any) -> Provenance:
    """Return the origin of a measurement by a command with its options that are not the default."""
    words = ["python -m hybridmpm_lab", command]
    for one in dataclasses.fields(settings):
        value = getattr(settings, one.name)
        if value != one.default:
            several = value if isinstance(one.default, tuple) else (value,)
            words += [f"{_option(one.name)} {given}" for given in several]
    return provenance(" ".join(words))


def _in_a_folder(_context: click.Context, option: click.Parameter, file: Path | None) -> Path | None:
    if file is not None and not file.parent.is_dir():
        raise click.UsageError(f"{option.opts[0]}: the folder {file.parent} does not exist.")
    return file


def file_option(name: str, text: str, *, exists: bool = False) -> click.Option:
    """Return an option for a file, as the argument `..._file`."""
    kind = click.Path(exists=exists, dir_okay=False, path_type=Path)
    names = [f"--{name}", f"{name}_file"]
    return click.Option(names, type=kind, metavar="FILE", callback=_in_a_folder, help=text)


def number_option(name: str, low: int, high: int, default: int, text: str) -> click.Option:
    """Return an option for one whole number."""
    return click.Option([name], type=click.IntRange(low, high), default=default, show_default=True, help=text)


runs_option = file_option(
    "runs", "File to which runs are appended; the same command resumes with it after an interruption."
)


def measured(measure: Callable[[Any, Progress], Iterable[Row]]) -> Callable[[Any, Provenance], list[Row]]:
    """Return a measurement behind a bar of `settings.steps` steps, whose rows have their origin."""

    def run(settings: Any, origin: Provenance) -> list[Row]:
        with progress("Measuring", settings.steps) as bar:
            return [origin.stamped(row) for row in measure(settings, bar.update)]

    return run


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
    options: Sequence[click.Option] = ()
    """Further options."""

    def command(self) -> click.Command:
        """Return the command."""

        def run(
            rows_file: Path | None, json_file: Path | None, chart_file: Path | None = None, **more: Any
        ) -> None:
            if rows_file is None:
                fields = dataclasses.fields(self.settings)
                settings = self.settings(**{one.name: more.pop(one.name) for one in fields})
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

        text = "Print and draw the rows of this file of --json, and measure nothing."
        files = [
            file_option("rows", text, exists=True),
            file_option("json", "Write the rows to this JSON file, too."),
        ]
        if self.draw is not None:
            files.append(file_option("chart", "Draw the rows into this file."))
        params = [*self.options, *files, *settings_options(self.settings)]
        return click.Command(self.name, params=params, callback=run, help=inspect.cleandoc(self.summary))

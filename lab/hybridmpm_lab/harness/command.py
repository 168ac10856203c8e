"""A measurement as a command: its settings, which are its options, and the output of its rows."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from hybridmpm import scenarios
from hybridmpm.cli.progress import progress
from hybridmpm_lab.harness.provenance import Provenance, provenance
from hybridmpm_lab.harness.rows import Progress, Row, print_table, read_rows, write_rows

Option = Callable[[Callable[..., Any]], Callable[..., Any]]


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


def settings_options(settings: type[Any]) -> Option:
    """Return a decorator that gives a command the options of a settings class, as the argument `settings`.

    A field `scenario: tuple[str, ...]` becomes the option `--scenario`, which may be given several times.
    """
    fields = [one for one in dataclasses.fields(settings) if "text" in one.metadata]

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        def called(**values: Any) -> Any:
            given = {one.name: values.pop(one.name) for one in fields}
            return command(settings=settings(**given), **values)

        called.__doc__, called.__name__ = command.__doc__, command.__name__
        called.__click_params__ = getattr(command, "__click_params__", [])  # type: ignore[attr-defined]
        result: Callable[..., Any] = called
        for one in reversed(fields):
            several = isinstance(one.default, tuple)
            result = click.option(
                _option(one.name),
                one.name,
                type=one.metadata["kind"],
                is_flag=isinstance(one.default, bool),
                multiple=several,
                default=one.default,
                show_default=one.default not in ((), None),
                help=one.metadata["text"] + (" May be given several times." if several else ""),
            )(result)
        return result

    return decorate


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def origin_of(command: str, settings: Any) -> Provenance:
    """Return the origin of a measurement by a command with its options that are not the default."""
    words = ["python -m hybridmpm_lab", command]
    for one in dataclasses.fields(settings):
        value = getattr(settings, one.name)
        if "text" in one.metadata and value != one.default:
            several = value if isinstance(one.default, tuple) else (value,)
            words += [
                _option(one.name) if given is True else f"{_option(one.name)} {given}" for given in several
            ]
    return provenance(" ".join(words))


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

"""What the benches share: options, the origin of a measurement, and printing its rows."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm._support import charts
from hybridmpm.bench.report.provenance import Provenance, provenance, write_rows
from hybridmpm.cli.progress import progress


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


json_option = _file_option("--json", "json_file", _in_a_folder, "Also write the rows there.")
chart_option = _file_option("--chart", "chart_file", _drawable, "Also draw them there, as SVG and PNG.")
repeats_option = click.option(
    "--repeats", type=click.IntRange(1, 1000), default=9, show_default=True, help="The median is reported."
)


def many(name: str, kind: click.IntRange, default: tuple[int, ...], text: str) -> Callable[..., Any]:
    text += " May be given several times."
    return click.option(name, type=kind, multiple=True, default=default, show_default=True, help=text)


def source(command: str, **options: tuple[object, ...]) -> Provenance:
    words = [f"--{name} {value}" for name, values in options.items() for value in values if value is not None]
    return provenance(" ".join(["hybridmpm bench", command, *words]))


def measured(rows: Iterable[dict[str, Any]], count: int) -> list[dict[str, Any]]:
    done = []
    with progress("Measuring", count) as bar:
        for row in rows:
            done.append(row)
            bar.update(1)
    return done


def report(
    rows: Sequence[dict[str, Any]], columns: Sequence[str], origin: Provenance, json_file: Path | None
) -> None:
    if json_file is not None:
        write_rows(json_file, rows)
    widths = {name: max(len(name), *(len(str(row[name])) for row in rows)) for name in columns}
    click.echo("  ".join(name.rjust(widths[name]) for name in columns))
    for row in rows:
        click.echo("  ".join(str(row[name]).rjust(widths[name]) for name in columns))
    click.echo(f"{origin.machine}, {origin.date}, commit {origin.commit or 'unknown'}")

"""The page of validation: its figures and a chart for each case. The same build writes the same bytes."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm._support.files import replacing
from hybridmpm.cli.progress import progress
from hybridmpm.errors import DataError
from hybridmpm_lab.harness import charts
from hybridmpm_lab.validation import CASES
from hybridmpm_lab.validation.case import Check, Curve, Result

_HEADER = "| figure | measured | target | accepted | |\n|---|---:|---:|---:|---|\n"


def write(folder: Path, results: Mapping[str, Result]) -> None:
    """Draw NAME.svg for each case into a folder, and renew its figures in the folder's README.md.

    Raises
    ------
    DataError
        The page has no section of a case.
    ExportError
        A file could not be written.
    """
    page = folder / "README.md"
    text = page.read_text(encoding="utf-8") if page.exists() else ""
    for name, result in results.items():
        text = renewed(text, name, result.checks)
        _draw(result, folder / f"{name}.svg")
    with replacing(page) as part:
        part.write_text(text, encoding="utf-8")


def renewed(text: str, name: str, checks: Sequence[Check]) -> str:
    """Return the text of the page with the figures of a case, and with the number of those that pass."""
    table = _HEADER + "".join(f"| {' | '.join(_cells(check))} |\n" for check in checks)
    text, count = re.subn(rf"(\]\({name}\.svg\)\n\n)(\|.*\n)*", lambda old: old[1] + table, text)
    if count != 1:
        raise DataError(f"the page has no section with the chart {name}.svg")
    passed, failed = text.count(" | pass |\n"), text.count(" | FAIL |\n")
    summary = f"{passed} of {passed + failed} judged figures pass.\n"
    return re.sub(r"\d+ of \d+ judged figures pass\.\n", summary, text, count=1)


def _cells(check: Check) -> tuple[str, ...]:
    # A zero has no sign.
    return check.quantity, f"{check.measured + 0.0:.3g}", check.target, check.tolerance, check.verdict


def text_table(checks: Sequence[Check]) -> str:
    """Return the figures as a table for a terminal."""
    cells = [_cells(check) for check in checks]
    widths = [max(len(row[k]) for row in cells) for k in range(5)]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    )


def _draw(result: Result, file: Path) -> None:
    figure, (row,) = charts.panels(len(result.panels))
    for axes, panel in zip(row, result.panels, strict=True):
        for curve in panel.curves:
            axes.plot(curve.x, curve.y, **_style(curve))
        axes.set(title=panel.title, xlabel=panel.xlabel, ylabel=panel.ylabel, **panel.options)
        if axes.get_xscale() == "log":
            axes.minorticks_off()
        if any(curve.label for curve in panel.curves):
            below: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.17)}
            columns = panel.legend_columns
            axes.legend(fontsize=8, **(below | {"ncols": columns} if columns else {}))
    charts.save(figure, file)


def _style(curve: Curve) -> dict[str, Any]:
    style: dict[str, Any] = {"color": "black" if curve.colour is None else charts.COLOURS[curve.colour]}
    if curve.style == "o":
        style |= {"linestyle": "none", "marker": charts.MARKERS[curve.colour or 0], "markersize": 4.5}
    else:
        style |= {"linestyle": curve.style, "linewidth": 1 if curve.colour is None else 1.5}
    return style | {"label": curve.label or None} | dict(curve.options)


@click.command()
@click.argument("cases", nargs=-1, type=click.Choice(list(CASES)), metavar="[CASE]...")
@click.option(
    "--out",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Folder of the page, README.md, whose figures and charts of these cases are renewed.",
)
@click.pass_context
def validate(ctx: click.Context, cases: tuple[str, ...], out: Path | None) -> None:
    """Compare the solver with experiments and closed forms, and print each figure with its target.

    All cases are run if none is named. The exit status is 1 if a figure is outside its tolerance.
    """
    chosen = [name for name in CASES if name in cases or not cases]
    results = {}
    with progress("Validating", len(chosen)) as bar:
        for name in chosen:
            results[name] = CASES[name]()
            bar.update(1)
    for name, result in results.items():
        click.echo(f"{name}\n{text_table(result.checks)}\n")
    if out is not None:
        write(out, results)
        click.echo(f"wrote {out / 'README.md'} and its charts")
    failed = any(check.verdict == "FAIL" for result in results.values() for check in result.checks)
    ctx.exit(1 if failed else 0)

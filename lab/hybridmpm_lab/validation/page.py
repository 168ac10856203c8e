"""The page of validation: README.md and a chart for each case. The same build writes the same bytes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm._support.files import replacing
from hybridmpm.cli.progress import progress
from hybridmpm_lab.harness import charts
from hybridmpm_lab.validation import CASES
from hybridmpm_lab.validation.case import Case, Check, Curve, Result

_HEADER = "| figure | measured | target | accepted | |\n|---|---:|---:|---:|---|\n"
_INTRO = """\
# Validation

The solver compared with experiments and closed forms from the literature. `python -m hybridmpm_lab validate`
writes this page and its charts. The tests run the same functions, some shorter, with the same tolerances.

"""

Outcome = tuple[str, Case, Result]
"""Name, case and result of a run."""


def write(folder: Path, outcomes: Sequence[Outcome]) -> None:
    """Write NAME.svg for each case, and README.md, into an existing folder.

    Raises
    ------
    ConfigError
        matplotlib is not installed.
    ExportError
        A file could not be written.
    """
    for name, _, result in outcomes:
        _draw(result, folder / f"{name}.svg")
    with replacing(folder / "README.md") as part:
        part.write_text(markdown(outcomes), encoding="utf-8")


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Return the text of the page."""
    verdicts = [check.verdict for _, _, result in outcomes for check in result.checks]
    summary = f"{verdicts.count('pass')} of {len(verdicts) - verdicts.count('reported')} judged figures pass"
    failed = [
        f"[{case.title.lower()}](#{case.title.lower().replace(' ', '-')}), {check.quantity}"
        for _, case, result in outcomes
        for check in result.checks
        if check.verdict == "FAIL"
    ]
    misses = f"; these do not: {'; '.join(failed)}" if failed else ""
    return f"{_INTRO}{summary}{misses}.\n" + "".join(_section(*one) for one in outcomes)


def _section(name: str, case: Case, result: Result) -> str:
    table = "".join(f"| {' | '.join(_cells(check))} |\n" for check in result.checks)
    return f"\n## {case.title}\n\n{case.text}\n![{case.title}]({name}.svg)\n\n{_HEADER}{table}"


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
            axes.legend(fontsize=8)
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
    help="Folder to write a page of these cases to: README.md and charts.",
)
@click.pass_context
def validate(ctx: click.Context, cases: tuple[str, ...], out: Path | None) -> None:
    """Compare the solver with experiments and closed forms, and print each figure with its target.

    All cases are run if none is named. The exit status is 1 if a figure is outside its tolerance.
    """
    chosen = [name for name in CASES if name in cases or not cases]
    outcomes = []
    with progress("Validating", len(chosen)) as bar:
        for name in chosen:
            case = CASES[name]
            outcomes.append((name, case, case.run()))
            bar.update(1)
    for _, case, result in outcomes:
        click.echo(f"{case.title}\n{text_table(result.checks)}\n")
    if out is not None:
        write(out, outcomes)
        click.echo(f"wrote {out / 'README.md'} and its charts")
    failed = any(check.verdict == "FAIL" for _, _, result in outcomes for check in result.checks)
    ctx.exit(1 if failed else 0)

"""The page of validation: README.md and a chart for each case. The same build writes the same bytes."""

from collections.abc import Sequence
from pathlib import Path

from hybridmpm._support import charts
from hybridmpm._support.files import replacing
from hybridmpm_lab.validation.case import Case, CaseResult, Check

_HEADER = "| figure | measured | target | accepted | |\n|---|---:|---:|---:|---|\n"


def write(folder: Path, results: Sequence[tuple[Case, CaseResult]]) -> None:
    """Write NAME.svg and NAME.png for each case, and README.md, into an existing folder.

    Raises
    ------
    ConfigError
        matplotlib is not installed.
    ExportError
        A file could not be written.
    """
    for case, result in results:
        charts.save(case.draw(result), folder / f"{case.name}.svg")
    with replacing(folder / "README.md") as part:
        part.write_text(markdown(results), encoding="utf-8")


def markdown(results: Sequence[tuple[Case, CaseResult]]) -> str:
    """Return the text of the page."""
    verdicts = [check.verdict for _, result in results for check in result.checks]
    summary = f"{verdicts.count('pass')} of {len(verdicts) - verdicts.count('reported')} judged figures pass"
    failed = [
        f"[{case.title.lower()}](#{case.title.lower().replace(' ', '-')}), {check.quantity}"
        for case, result in results
        for check in result.checks
        if check.verdict == "FAIL"
    ]
    misses = f"; these do not: {'; '.join(failed)}" if failed else ""
    intro = f"""\
# Validation

The solver compared with experiments and closed forms from the literature. `python -m hybridmpm_lab validate`
writes this page and its charts. The tests run the same functions, some of them shorter, with the same tolerances.

{summary}{misses}.
"""
    return intro + "".join(_section(case, result) for case, result in results)


def _section(case: Case, result: CaseResult) -> str:
    table = "".join(f"| {' | '.join(_cells(check))} |\n" for check in result.checks)
    return f"\n## {case.title}\n\n{case.text}\n\n![{case.title}]({case.name}.svg)\n\n{_HEADER}{table}"


def _cells(check: Check) -> tuple[str, ...]:
    return check.quantity, figure(check.measured), check.target, check.tolerance, check.verdict


def figure(value: float) -> str:
    """Return a figure with three digits; a zero has no sign."""
    return f"{value + 0.0:.3g}"


def text_table(checks: Sequence[Check]) -> str:
    """Return the figures as a table for a terminal."""
    cells = [_cells(check) for check in checks]
    widths = [max(len(row[k]) for row in cells) for k in range(5)]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    )

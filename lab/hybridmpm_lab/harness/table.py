"""The table of a comparison: rows against each other on one Pareto front, and on the screen."""

from collections.abc import Iterable, Sequence

import click

from hybridmpm.metrics import Estimate
from hybridmpm_lab.harness.rows import Row, significant


def dominating(row: Row, others: Sequence[Row], measure: str = "error") -> Row | None:
    """Return the quickest of the others that is neither slower nor worse than a row, and not equal in both.

    Rows without the measure or `ms_per_frame` neither dominate nor are dominated.
    """
    if not _is_measured(row, measure):
        return None
    mine = (row["ms_per_frame"], row[measure])
    better = [
        other
        for other in others
        if _is_measured(other, measure)
        and other["ms_per_frame"] <= mine[0]
        and other[measure] <= mine[1]
        and (other["ms_per_frame"], other[measure]) != mine
    ]
    return min(better, key=lambda other: other["ms_per_frame"], default=None)


def is_on_front(row: Row, others: Sequence[Row], measure: str = "error") -> bool:
    """Return whether a row is on the Pareto front of time and a measure among rows of one case."""
    return _is_measured(row, measure) and dominating(row, others, measure) is None


def equal_error(row: Row, others: Sequence[Row]) -> Row | None:
    """Return the quickest of the others that errs at most as much: a method pays only below its time."""
    if row["error"] is None:
        return None
    as_good = [other for other in others if _is_measured(other, "error") and other["error"] <= row["error"]]
    return min(as_good, key=lambda other: other["ms_per_frame"], default=None)


def mean_fields(name: str, values: Iterable[float | None], digits: int = 4) -> Row:
    """Return the mean of those values that are there, and its standard error to some digits as `..._se`."""
    there = [value for value in values if value is not None]
    found = Estimate.of(there) if there else None
    spread = significant(found.standard_error if found else None, digits)
    return {name: significant(found.mean if found else None), f"{name}_se": spread}


def row_name(row: Row) -> str:
    """Return the method and label of a row."""
    return " ".join(part for part in (row["method"], row["label"]) if part)


def print_table(rows: Sequence[Row], columns: Sequence[str]) -> None:
    """Print some columns of the rows, each as wide as its widest cell; a row may lack some of them."""
    cells = [["" if row.get(name) is None else str(row[name]) for name in columns] for row in rows]
    widths = [max(map(len, column)) for column in zip(columns, *cells, strict=True)]
    for line in (columns, *cells):
        click.echo("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)))


def _is_measured(row: Row, measure: str) -> bool:
    return row[measure] is not None and row["ms_per_frame"] is not None

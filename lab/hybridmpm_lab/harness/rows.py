"""Rows of figures: their files, their comparison and print, and the seeds and frames of all errors."""

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, DataError, ExportError
from hybridmpm.metrics import Estimate

Row = dict[str, Any]
"""One measurement, or all that was measured of one method: a flat object of JSON."""

Key = tuple[object, ...]
"""Key of a row in a store."""

Progress = Callable[[int], object]
"""Function that takes the number of steps done since its last call."""


def significant(value: float | None, digits: int = 4) -> float | None:
    """Round a figure to so many significant digits; None stays None."""
    return None if value is None else float(f"{value:.{digits}g}")


FIRST_SEED = 1_100_000
"""Seed of the first test scene of each scenario: no data set and no fit goes so far."""
AT = (40, 100, 200)
"""Frames, counted from the start of a measurement, whose errors are reported alone."""
EVERY = 10
"""Frames between two states that are compared."""


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as a JSON list of flat objects, one a line; raises `ExportError`.

    The first row has all fields. The others lack those that are None, which `read_rows` fills in.
    """
    first = dict.fromkeys(name for row in rows for name in row) | rows[0]
    short = [{name: value for name, value in row.items() if value is not None} for row in rows[1:]]
    with replacing(path) as part:
        lines = ",\n".join(json.dumps(row, separators=(",", ":")) for row in (first, *short))
        part.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def read_rows(path: Path) -> list[Row]:
    """Read a file of `write_rows`; raises `DataError` where it is none."""
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        empty = dict.fromkeys(name for row in rows for name in row)
        return [empty | row for row in rows]
    except (OSError, ValueError, TypeError) as error:
        raise DataError(f"{path} has no rows of a result: {error}") from None


class RowStore:
    """Rows by key, appended to a file where one is given.

    The first line of the file has the settings, each later one a key and its row. An unfinished last line, as
    an interruption leaves it, is dropped.

    `settings` are those that rows must share to be compared. The file is resumed or created; without one,
    rows are kept in memory.

    Raises
    ------
    ConfigError, DataError, ExportError
        The file has rows of other settings; is damaged; cannot be written to.
    """

    def __init__(self, settings: Row, file: Path | None = None) -> None:
        self._file = file
        self._rows: dict[Key, Row] = {}
        if file is not None and file.exists() and file.stat().st_size > 0:
            self._read(file, settings)
        else:
            self._write({"settings": settings})

    def __contains__(self, key: Key) -> bool:
        return key in self._rows

    def __getitem__(self, key: Key) -> Row:
        return self._rows[key]

    def get(self, key: Key) -> Row | None:
        """Return the row of a key; None where there is none."""
        return self._rows.get(key)

    def add(self, key: Key, row: Row) -> None:
        """Add a row; raises `ExportError`."""
        self._write({"key": key, "row": row})
        self._rows[key] = row

    def _read(self, file: Path, settings: Row) -> None:
        whole, _, rest = file.read_text(encoding="utf-8").rpartition("\n")
        try:
            first, *entries = [json.loads(line) for line in whole.splitlines()]
            there = first["settings"]
            self._rows = {tuple(entry["key"]): entry["row"] for entry in entries}
        except (ValueError, KeyError, TypeError):
            raise DataError(f"{file} is no file of rows, or damaged; take another one") from None
        for name, value in settings.items():
            if there.get(name) != value:
                raise ConfigError(
                    f"{file} has rows with {name} = {there.get(name)}, not {value}: take the same settings "
                    "or another file"
                )
        if rest:
            with replacing(file) as part:
                part.write_text(whole + "\n", encoding="utf-8")

    def _write(self, entry: Row) -> None:
        if self._file is None:
            return
        try:
            with self._file.open("a", encoding="utf-8") as out:
                out.write(json.dumps(entry) + "\n")
        except OSError as error:
            raise ExportError(f"cannot write {self._file}: {error.strerror or error}") from error


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

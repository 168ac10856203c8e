"""Rows of figures, their files, and the seeds and frames of all errors."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, DataError, ExportError

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
    ConfigError
        The file has rows of other settings; the message names the first that differs.
    DataError
        The file is damaged.
    ExportError
        The file cannot be written to.
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

"""The file in which the rows of a long benchmark gather, so that it can be interrupted and go on."""

import json
from pathlib import Path

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, DataError, ExportError
from hybridmpm_lab.harness.rows import Row


class Gathered:
    """Rows by key, in a file of JSON lines where one is given.

    The first line holds the settings, each later one a key and its row. What an interruption left of a last
    line is dropped.

    Parameters
    ----------
    settings : dict
        What rows must share to be compared.
    file : Path, optional
        File to go on with, or to begin; without it rows are kept in memory.

    Raises
    ------
    ConfigError
        The file holds rows of other settings; the message names the first that differs.
    DataError
        The file is damaged.
    ExportError
        The file cannot be written to.
    """

    def __init__(self, settings: Row, file: Path | None = None) -> None:
        self._file = file
        self._rows: dict[tuple[object, ...], Row] = {}
        if file is not None and file.exists() and file.stat().st_size > 0:
            self._read(file, settings)
        else:
            self._write({"settings": settings})

    def has(self, key: tuple[object, ...]) -> bool:
        """Tell whether there is a row of this key."""
        return key in self._rows

    def row(self, key: tuple[object, ...]) -> Row:
        """Return the row of a key that is there."""
        return self._rows[key]

    def add(self, key: tuple[object, ...], row: Row) -> None:
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
                    f"{file} holds rows with {name} = {there.get(name)}, not {value}: take the same settings "
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

"""Rows of a long measurement in a file of JSON lines, so that it can be interrupted and resumed."""

import json
from pathlib import Path

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, DataError, ExportError
from hybridmpm_lab.harness.rows import Row

Key = tuple[object, ...]


class RowStore:
    """Rows by key, appended to a file where one is given.

    The first line of the file has the settings, each later one a key and its row. An unfinished last line, as
    an interruption leaves it, is dropped.

    Parameters
    ----------
    settings : dict
        Settings that rows must share to be compared.
    file : Path, optional
        File to resume or to create; without it rows are kept in memory.

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

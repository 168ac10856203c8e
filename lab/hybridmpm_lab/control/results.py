"""The file in which runs gather, line by line, so that an interrupted benchmark goes on where it stopped."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, DataError, ExportError
from hybridmpm_lab.control.suite.cases import Case
from hybridmpm_lab.harness.rows import Row

_Floats = npt.NDArray[np.float64]
Key = tuple[str, str, str, int, str]


class Runs:
    """All runs of a benchmark, in a file of JSON lines where one is given.

    The first line holds the settings, each later one a run or the frames of an uncontrolled scene. What an
    interruption left of a last line is dropped.

    Parameters
    ----------
    settings : dict
        What runs must share to be compared: digest of the suite, cap, hold.
    file : Path, optional
        File to go on with, or to begin; without it runs are kept in memory.

    Raises
    ------
    ConfigError
        The file holds runs of other settings; the message names the first that differs.
    DataError
        The file is damaged.
    ExportError
        The file cannot be written to.
    """

    def __init__(self, settings: dict[str, Any], file: Path | None = None) -> None:
        self._file = file
        self._rows: dict[Key, Row] = {}
        self._looks: dict[Key, _Floats] = {}
        self._references: dict[str, dict[int, _Floats]] = {}
        if file is not None and file.exists() and file.stat().st_size > 0:
            self._read(file, settings)
        else:
            self._write({"settings": settings})

    def has(self, case: Case, method: str) -> bool:
        """Tell whether a method has run on a case."""
        return _key(case, method) in self._rows

    def add(self, row: Row, looks: list[list[float]]) -> None:
        """Add a run and the features of its frames; raises `ExportError`."""
        self._write({"run": row, "looks": looks})
        self._enter(row, looks)

    def reference_seeds(self, scenario: str) -> set[int]:
        """Return the seeds of a scenario whose uncontrolled frames are there."""
        return set(self._references.get(scenario, ()))

    def add_reference(self, scenario: str, seed: int, looks: list[list[float]]) -> None:
        """Add features of uncontrolled frames (K, 13) of a scenario's seed; raises `ExportError`."""
        self._write({"reference": scenario, "seed": seed, "looks": looks})
        self._references.setdefault(scenario, {})[seed] = np.array(looks)

    def references(self, scenario: str) -> list[_Floats]:
        """Return features (K, 13) of uncontrolled frames, an array for each seed in ascending order."""
        return [looks for _, looks in sorted(self._references.get(scenario, {}).items())]

    def rows(self, cases: Iterable[Case], methods: Iterable[str]) -> list[Row]:
        """Return the rows of the cases and methods that are there."""
        names = list(methods)
        keys = (_key(case, name) for case in cases for name in names)
        return [self._rows[key] for key in keys if key in self._rows]

    def looks(self, cases: Iterable[Case], method: str) -> list[_Floats]:
        """Return features (K, 13) of a method's frames, an array for each case that has run."""
        keys = (_key(case, method) for case in cases)
        return [self._looks[key] for key in keys if key in self._looks]

    def _enter(self, row: Row, looks: list[list[float]]) -> None:
        key = (row["family"], row["scenario"], row["sketch"], row["seed"], row["method"])
        self._rows[key] = row
        if looks:
            self._looks[key] = np.array(looks)

    def _read(self, file: Path, settings: dict[str, Any]) -> None:
        try:
            whole, _, rest = file.read_text(encoding="utf-8").rpartition("\n")
            entries = [json.loads(line) for line in whole.splitlines()]
            there = entries[0]["settings"]
        except (ValueError, IndexError, KeyError, TypeError):
            raise DataError(f"{file} is no file of runs, or damaged; take another one") from None
        for name, value in settings.items():
            if there.get(name) != value:
                raise ConfigError(
                    f"{file} holds runs with {name} = {there.get(name)}, not {value}: take the same settings "
                    "or another file"
                )
        if rest:
            with replacing(file) as part:
                part.write_text(whole + "\n", encoding="utf-8")
        try:
            for entry in entries[1:]:
                if "run" in entry:
                    self._enter(entry["run"], entry["looks"])
                else:
                    looks = np.array(entry["looks"])
                    self._references.setdefault(entry["reference"], {})[entry["seed"]] = looks
        except (KeyError, TypeError, ValueError):
            raise DataError(f"{file} is damaged; take another one") from None

    def _write(self, entry: dict[str, Any]) -> None:
        if self._file is None:
            return
        try:
            with self._file.open("a", encoding="utf-8") as out:
                out.write(json.dumps(entry) + "\n")
        except OSError as error:
            raise ExportError(f"cannot write {self._file}: {error.strerror or error}") from error


def _key(case: Case, method: str) -> Key:
    return case.family, case.scenario, case.kind, case.seed, method

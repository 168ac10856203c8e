"""The folder in which the results of a sweep grow, one point at a time."""

import functools
import json
import math
import operator
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Protocol

from hybridmpm.bench.report.pareto import compared, dominating
from hybridmpm.bench.report.provenance import Provenance, write_rows
from hybridmpm.bench.report.rows import Progress, Row
from hybridmpm.bench.sweep.family import POINTS, SCENARIOS, Point, SweepSettings
from hybridmpm.errors import ConfigError, DataError, ExportError

_SETTINGS = "settings.json"
_NEEDED = ("scenario", "method", "label", "trained", "ms_per_frame", "error")
"""Fields that every row has, because rows are compared by them."""
# Folders within the folder of results.
_POINTS, _LATENCIES, _REFERENCES, _LADDERS = "points", "latencies", "references", "ladders"


class Runner(Protocol):
    """Whoever measures the points of a sweep."""

    def references(self, scenario: str) -> Sequence[Row]:
        """Return rows with the errors of MPM, of zero networks and of the bounds."""

    def ladder(self, scenario: str) -> Sequence[Row]:
        """Return the latencies of MPM, a row for each `label`."""

    def errors(self, point: Point, minutes: float) -> Row:
        """Train a network for some minutes, and return its errors."""

    def latency(self, point: Point) -> Row:
        """Return the latency of a network."""


class SweepResults:
    """A folder with a file for each training and each latency, which fills up point by point.

    Latencies have files of their own: a latency wants a machine on which nothing else runs, and it does not
    depend on the weights.

    Parameters
    ----------
    folder : Path
        Folder of the results, made where it is missing.
    settings : SweepSettings

    Raises
    ------
    ConfigError
        The folder holds points of other settings; the message names both values.
    DataError
        A file in the folder is damaged.
    ExportError
        The folder cannot be written to.
    """

    def __init__(self, folder: Path, settings: SweepSettings) -> None:
        self._folder = folder
        for name in (_POINTS, _LATENCIES, _REFERENCES, _LADDERS):
            try:
                (folder / name).mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise ExportError(f"cannot write to {folder / name}: {error.strerror or error}") from error
        file = folder / _SETTINGS
        if not file.exists():
            write_rows(file, [asdict(settings)])
        there = _read(file)[0]
        for name, value in asdict(settings).items():
            if there.get(name) != value:
                raise ConfigError(
                    f"{folder} holds points with {name} = {there.get(name)}, not {value}; take the same "
                    "settings or another folder"
                )

    def untrained(self, points: Sequence[Point], minutes: float) -> list[Point]:
        """Return the points with less training than `minutes`."""
        return [point for point in points if self._minutes(point) < minutes]

    def untimed(self, points: Sequence[Point]) -> list[Point]:
        """Return the points whose latency is not known."""
        return [point for point in points if not self._file(_LATENCIES, point.key).exists()]

    def train(
        self,
        points: Sequence[Point],
        minutes: float,
        runner: Runner,
        source: Provenance,
        on_progress: Progress,
    ) -> None:
        """Train the points that have had less training, and write the errors of each after its training.

        Raises
        ------
        ExportError
            A file cannot be written. Errors of the runner pass through.
        """
        for scenario in dict.fromkeys(point.scenario for point in points):
            file = self._file(_REFERENCES, scenario)
            if not file.exists():
                write_rows(file, [source.stamped(row) for row in runner.references(scenario)])
        for point in self.untrained(points, minutes):
            row = source.stamped(runner.errors(point, minutes))
            write_rows(self._file(_POINTS, point.key), [row])
            on_progress(1)

    def time(
        self,
        points: Sequence[Point],
        runner: Runner,
        source: Provenance,
        on_progress: Progress,
    ) -> None:
        """Measure the latencies that are missing; raises as `train`."""
        when = {"timed_date": source.date, "timed_commit": source.commit}
        for scenario in dict.fromkeys(point.scenario for point in points):
            file = self._file(_LADDERS, scenario)
            if not file.exists():
                write_rows(file, [row | when for row in runner.ladder(scenario)])
        for point in self.untimed(points):
            row = source.stamped(runner.latency(point)) | when
            write_rows(self._file(_LATENCIES, point.key), [row])
            on_progress(1)

    def worthwhile(self, points: Sequence[Point]) -> list[Point]:
        """Return the points that are quicker than MPM with all particles: no error could save the others."""
        return [
            point
            for point in points
            for mpm in self._there(_LADDERS, point.scenario)
            for network in self._there(_LATENCIES, point.key)
            if mpm["label"] == "1" and (network["ms_per_frame"] or math.inf) < (mpm["ms_per_frame"] or 0.0)
        ]

    def rows(self) -> list[Row]:
        """Return rows of the references and of all points measured, compared within each scenario."""
        found = []
        for scenario in SCENARIOS:
            ladder = {row["label"]: row for row in self._there(_LADDERS, scenario)}
            rows = [
                row | ladder.get(row["label"], {}) if row["method"] == "mpm" else row
                for row in self._there(_REFERENCES, scenario)
            ]
            for point in POINTS:
                if point.scenario == scenario:
                    # Fields of the training come last: it is later than the timing.
                    parts = (*self._there(_LATENCIES, point.key), *self._there(_POINTS, point.key))
                    rows += [functools.reduce(operator.or_, parts)] if parts else []
            found.append(rows)
        names = dict.fromkeys((*_NEEDED, *(name for rows in found for row in rows for name in row)))
        return [row for rows in found for row in compared([dict.fromkeys(names) | row for row in rows])]

    def survivors(self) -> list[Point]:
        """Return the trained points that no other trained point of their scenario dominates."""
        trained = [row for row in self.rows() if row["method"] == "neural" and row["trained"]]
        best = {
            (row["scenario"], row["label"])
            for row in trained
            if row["error"] is not None
            and row["ms_per_frame"] is not None
            and dominating(row, [one for one in trained if one["scenario"] == row["scenario"]]) is None
        }
        return [point for point in POINTS if (point.scenario, point.name) in best]

    def _file(self, kind: str, name: str) -> Path:
        return self._folder / kind / f"{name}.json"

    def _there(self, kind: str, name: str) -> list[Row]:
        file = self._file(kind, name)
        return _read(file) if file.exists() else []

    def _minutes(self, point: Point) -> float:
        """Return how long a point has been trained; 0 where it has not been."""
        return max((float(row["minutes"]) for row in self._there(_POINTS, point.key)), default=0.0)


def _read(file: Path) -> list[Row]:
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))
        if not (isinstance(rows, list) and rows and all(isinstance(row, dict) for row in rows)):
            raise ValueError("no list of objects")  # noqa: TRY301 - as of a damaged file
    except (OSError, ValueError) as error:
        raise DataError(f"{file} is damaged: {error}; delete it to have it measured anew") from None
    return rows

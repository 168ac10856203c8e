"""Error against latency over the family of networks: r_t, r_p, sizes and radii, one point at a time."""

import dataclasses
import fnmatch
import functools
import itertools
import json
import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hybridmpm.bench.accuracy.methods import RATIOS
from hybridmpm.bench.report.pareto import Row, compared, dominating
from hybridmpm.bench.report.provenance import Provenance, write_rows
from hybridmpm.errors import ConfigError, DataError, ExportError
from hybridmpm.physics.spec import NetworkSpec

if TYPE_CHECKING:
    from hybridmpm.bench.sweep.runner import Laboratory

SCENARIOS = ("water_2d", "sand_2d")
STRIDES = (1, 2, 4, 8, 16)
"""r_t."""
SIZES = {"32x3": (32, 3, 1), "64x4": (64, 4, 1), "128x10": (128, 10, 2)}
"""Latent, layers and hidden layers by label; the last is the paper's network."""
RADII = (2.2, 2.9)
"""Connectivity radius in spacings of the particles; the latter is the paper's."""

_SETTINGS = "settings.json"
_NEEDED = ("scenario", "method", "label", "trained", "ms_per_frame", "error")
"""Fields that rows are compared by."""
# Folders of results.
_POINTS, _LATENCIES, _REFERENCES, _LADDERS = "points", "latencies", "references", "ladders"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What all points of a sweep have in common; a folder of results holds points of one such."""

    scenes: int = 10
    """Of each scenario."""
    span: int = 200
    """Frames counted in each scene."""
    threads: int = 1
    """Of every simulator."""
    relaxations: int = 3
    """Of density, after each step of each network."""
    trajectories: int = 40
    """That each network is trained on."""
    frames: int = 320
    """Of a trajectory."""
    batch: int = 2
    unroll: int = 3
    seed: int = 0
    """Of initial weights and draws."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """A member of the family on a scenario."""

    scenario: str
    r_t: int
    ratio: str
    """Label of r_p in `RATIOS`."""
    size: str
    """Label in `SIZES`."""
    spacings: float
    """Connectivity radius."""

    @property
    def name(self) -> str:
        """What it is, but for the scenario."""
        return f"t{self.r_t}-p{self.ratio.replace('/', '_')}-{self.size}-R{self.spacings}"

    @property
    def key(self) -> str:
        """Name of its files, and what patterns are matched with."""
        return f"{self.scenario}-{self.name}"

    def spec(self, relaxations: int) -> NetworkSpec:
        """Return its network."""
        latent, layers, hidden_layers = SIZES[self.size]
        spec = NetworkSpec(
            scenarios=(self.scenario,),
            latent=latent,
            layers=layers,
            hidden_layers=hidden_layers,
            radius=1.0,
            r_p=RATIOS[self.ratio],
            r_t=self.r_t,
            relaxations=relaxations,
        )
        return dataclasses.replace(spec, radius=round(self.spacings * spec.spacing, 6))


POINTS = tuple(
    Point(scenario=scenario, r_t=r_t, ratio=ratio, size=size, spacings=spacings)
    for scenario, ratio, r_t, size, spacings in itertools.product(
        SCENARIOS, reversed(RATIOS), reversed(STRIDES), SIZES, RADII
    )
)
"""All of them, those that share training data side by side, the quick ones first."""


def matching(patterns: Sequence[str]) -> list[Point]:
    """Return the points whose key matches one of the shell patterns, all without patterns.

    Raises
    ------
    ConfigError
        A pattern matches none.
    """
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(point.key, pattern) for point in POINTS):
            raise ConfigError(
                f"no point matches {pattern!r}; their names are like {POINTS[0].key} and {POINTS[-1].key}, "
                "and * stands for anything"
            )
    return [
        point
        for point in POINTS
        if not patterns or any(fnmatch.fnmatchcase(point.key, pattern) for pattern in patterns)
    ]


class Sweep:
    """A folder of results, with a file for each training and each latency, that grows until all are there.

    Latencies are kept apart: they want a machine where nothing else runs, and do not depend on weights.

    Parameters
    ----------
    folder : Path
        Made where missing.
    settings : Settings

    Raises
    ------
    ConfigError
        The folder holds points of other settings; the message names both values.
    DataError
        A file in it is damaged.
    ExportError
        It cannot be written to.
    """

    def __init__(self, folder: Path, settings: Settings) -> None:
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
        laboratory: "Laboratory",
        source: Provenance,
        on_progress: Callable[[int], object],
    ) -> None:
        """Train what has been trained for less, and measure errors; each is written as soon as it is known.

        The laboratory needs torch, this module does not.

        Raises
        ------
        ExportError
            A file cannot be written; and what the laboratory raises.
        """
        for scenario in dict.fromkeys(point.scenario for point in points):
            file = self._file(_REFERENCES, scenario)
            if not file.exists():
                write_rows(file, [row | asdict(source) for row in laboratory.references(scenario)])
        for point in self.untrained(points, minutes):
            row = laboratory.errors(point, minutes) | asdict(source)
            write_rows(self._file(_POINTS, point.key), [row])
            on_progress(1)

    def time(
        self,
        points: Sequence[Point],
        laboratory: "Laboratory",
        source: Provenance,
        on_progress: Callable[[int], object],
    ) -> None:
        """Measure latencies that are missing; raises as `train`."""
        when = {"timed_date": source.date, "timed_commit": source.commit}
        for scenario in dict.fromkeys(point.scenario for point in points):
            file = self._file(_LADDERS, scenario)
            if not file.exists():
                write_rows(file, [row | when for row in laboratory.ladder(scenario)])
        for point in self.untimed(points):
            row = laboratory.latency(point) | asdict(source) | when
            write_rows(self._file(_LATENCIES, point.key), [row])
            on_progress(1)

    def worthwhile(self, points: Sequence[Point]) -> list[Point]:
        """Return those that are quicker than MPM with all particles: no error could save the others."""
        return [
            point
            for point in points
            for mpm in self._there(_LADDERS, point.scenario)
            for network in self._there(_LATENCIES, point.key)
            if mpm["label"] == "1" and (network["ms_per_frame"] or math.inf) < (mpm["ms_per_frame"] or 0.0)
        ]

    def rows(self) -> list[Row]:
        """Return the references and all points that are there, compared with each other by scenario."""
        found = []
        for scenario in SCENARIOS:
            ladder = {row["label"]: row for row in self._there(_LADDERS, scenario)}
            rows = [
                row | ladder.get(row["label"], {}) if row["method"] == "mpm" else row
                for row in self._there(_REFERENCES, scenario)
            ]
            for point in POINTS:
                if point.scenario == scenario:
                    # What training says of the same things is later.
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
        """Training that a point has had, 0 where it is not there."""
        return max((float(row["minutes"]) for row in self._there(_POINTS, point.key)), default=0.0)


def _read(file: Path) -> list[Row]:
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))
        if not (isinstance(rows, list) and rows and all(isinstance(row, dict) for row in rows)):
            raise ValueError("no list of objects")  # noqa: TRY301 - as of a damaged file
    except (OSError, ValueError) as error:
        raise DataError(f"{file} is damaged: {error}; delete it to have it measured anew") from None
    return rows

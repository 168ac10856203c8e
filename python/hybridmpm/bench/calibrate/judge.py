"""Plans against what is measured: on held-out scenes that no calibration has seen."""

import itertools
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hybridmpm import scenarios as library
from hybridmpm.bench.accuracy.conventions import FIRST_SEED
from hybridmpm.bench.accuracy.latency import first_frame
from hybridmpm.bench.report.gathered import Gathered
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.bench.report.rows import Progress, Row, significant
from hybridmpm.bench.tradeoff.errors import scene_errors
from hybridmpm.bench.tradeoff.settings import TradeoffSettings, warm_up
from hybridmpm.bench.tradeoff.times import by_turns
from hybridmpm.downsampling import CarryingSimulator
from hybridmpm.errors import SimulationError
from hybridmpm.planner.candidates import candidates
from hybridmpm.planner.planning import prospective
from hybridmpm.scene import Scene

FIRST = FIRST_SEED + 2000
"""Seed of the first scene: the errors of a calibration are those of `FIRST_SEED` and what follows it."""
NEAR = 0.3
"""Part by which a time may be missed."""
KEY = ("scenario", "seed", "name")


@dataclass(frozen=True, kw_only=True)
class JudgeSettings:
    """Scenes and length of the comparison."""

    scenarios: tuple[str, ...] = library.NAMES
    """Scenarios of the scenes."""
    scenes: int = 3
    """Number of scenes of each scenario."""
    span: int = 200
    """Number of frames that errors count over and that are timed."""
    passes: int = 3
    """Number of times that each frame is timed; the lower quartile counts."""

    @property
    def seeds(self) -> range:
        """Seeds of the scenes."""
        return range(FIRST, FIRST + self.scenes)


class _Processor:
    """A simulator on one thread, timed by the processor: others who use the machine then add less."""

    def __init__(self, simulator: CarryingSimulator) -> None:
        self._simulator, self._start = simulator, simulator.snapshot()

    def restore(self) -> None:
        """Go back."""
        self._simulator.restore(self._start)

    def advance(self, frames: int) -> list[float]:
        """Go on, and return the processor time of each frame and of looking at it [s]."""
        spent = []
        for _ in range(frames):
            began = time.process_time()
            self._simulator.advance(1)
            _ = self._simulator.positions
            spent.append(time.process_time() - began)
        return spent


def judge(
    settings: JudgeSettings, runs: Gathered, origin: Provenance, on_progress: Progress
) -> Iterator[Row]:
    """Measure what is missing, and yield all rows; `on_progress` counts scenes.

    Rows of the part `run` tell, for each candidate in each scene, error and time, and what a plan expects of
    them. Rows of the part `mean` tell, for each scenario and for all, in which share of the runs the time was
    expected within 30 %, and in which share of the pairs of candidates in a scene it was expected rightly
    which of the two errs less.
    """
    rows = []
    for scenario in settings.scenarios:
        for seed in settings.seeds:
            rows += _scene_rows(scenario, seed, settings, runs, origin)
            on_progress(1)
    yield from rows
    for scenario in (*settings.scenarios, "all"):
        mine = [row for row in rows if scenario in (row["scenario"], "all")]
        yield origin.stamped({"part": "mean", "scenario": scenario} | _mean(mine))


def _scene_rows(
    scenario: str, seed: int, settings: JudgeSettings, runs: Gathered, origin: Provenance
) -> list[Row]:
    scene = library.get(scenario, seed)
    names = list(candidates(scenario))
    if not all(runs.has((scenario, seed, name)) for name in names):
        measured = dict(scene_errors(scenario, seed, names, TradeoffSettings(span=settings.span)))
        times = _times(scenario, scene, names, settings)
        expected = {one.name: one for one, _ in prospective(scene)}
        for name in names:
            one = expected.get(name)
            row = {
                "part": "run",
                **dict(zip(KEY, (scenario, seed, name), strict=True)),
                "error": measured[name].get("error"),
                "expected_error": significant(one.error if one else None),
                "ms_per_frame": times[name],
                "expected_ms": significant(one.ms_per_frame if one else None),
            }
            runs.add((scenario, seed, name), origin.stamped(row))
    return [runs.row((scenario, seed, name)) for name in names]


def _times(
    scenario: str, scene: Scene, names: Sequence[str], settings: JudgeSettings
) -> dict[str, float | None]:
    start, found = first_frame(scene, warm_up(scenario)), dict.fromkeys(names, None)
    timed: dict[str, _Processor] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in names:
            simulator = candidates(scenario)[name].make(scene)
            try:
                simulator.advance(start)
            except SimulationError:
                continue
            timed[name] = _Processor(simulator)
        spent = by_turns(list(timed.values()), settings.span, settings.passes, threads=1)
    ms = {name: one.fields()["ms_per_frame"] for name, one in zip(timed, spent, strict=True) if one}
    return found | ms


def _mean(rows: Sequence[Row]) -> Row:
    off = [
        abs(row["expected_ms"] / row["ms_per_frame"] - 1)
        for row in rows
        if row["ms_per_frame"] is not None and row["expected_ms"] is not None
    ]
    right = list(_pairs(rows))
    return {
        "runs": len(rows),
        "within_30_percent": significant(float(np.mean(np.array(off) <= NEAR))) if off else None,
        "off_p50": significant(float(np.median(off))) if off else None,
        "off_p95": significant(float(np.percentile(off, 95))) if off else None,
        "pairs": len(right),
        "pairs_right": significant(float(np.mean(right))) if right else None,
    }


def _pairs(rows: Sequence[Row]) -> Iterator[bool]:
    """Yield for each two candidates in a scene whether it was expected which of them errs less."""
    scenes: dict[tuple[str, int], list[Row]] = {}
    for row in rows:
        if row["error"] is not None and row["expected_error"] is not None:
            scenes.setdefault((row["scenario"], row["seed"]), []).append(row)
    for mine in scenes.values():
        for one, two in itertools.combinations(mine, 2):
            apart, expected = one["error"] - two["error"], one["expected_error"] - two["expected_error"]
            if apart and expected:
                yield (apart > 0) == (expected > 0)

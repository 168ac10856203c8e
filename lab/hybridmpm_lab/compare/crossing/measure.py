"""Errors and times of all who compete in a case."""

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hybridmpm import metrics
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_frame, first_impact
from hybridmpm.planner.candidates import loaded
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.accuracy.conventions import AT, EVERY, FIRST_SEED
from hybridmpm_lab.compare.accuracy.latency import step_latency
from hybridmpm_lab.compare.crossing.cases import Case, CrossingSettings
from hybridmpm_lab.compare.crossing.entrants import Enlarged, Entrant, entrants, networks
from hybridmpm_lab.compare.tradeoff.measures import after
from hybridmpm_lab.compare.tradeoff.settings import warm_up
from hybridmpm_lab.compare.tradeoff.times import FIELDS, OwnTiming, by_turns
from hybridmpm_lab.harness.grid import TrueGrids
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.harness.store import RowStore

ERRORS, TIMES, ALONE = "errors", "times", "latency alone"
"""First field of the keys of rows; the case follows, then the seed where there is one, and the name."""
_REFERENCE_STEP = 0.02
"""Time in which the ground truth goes on by a substep, for each metre of a cell's width [s/m]."""
_SECONDS = 3.0
"""Time for the steps of a network whose latency alone is taken [s]."""


def particles_of(case: Case) -> int:
    """Return the number of particles of the first scene of a case."""
    return len(case.scene(FIRST_SEED).sample().x)


def measure_errors(
    case: Case, settings: CrossingSettings, runs: RowStore, origin: Provenance, on_progress: Progress
) -> None:
    """Run what is missing of a case, scene by scene; `on_progress` counts cases."""
    rivals = entrants(case, settings, particles_of(case))
    for seed, scene in case.scenes(settings):
        missing = [name for name in rivals if (ERRORS, *case.key, seed, name) not in runs]
        if missing:
            for name, row in _scene_errors(case, scene, {name: rivals[name] for name in missing}, settings):
                runs.add((ERRORS, *case.key, seed, name), origin.stamped(row))
    on_progress(1)


def measure_times(
    case: Case, settings: CrossingSettings, runs: RowStore, origin: Provenance, on_progress: Progress
) -> None:
    """Time all of a case by turns on its first scene where one is missing; `on_progress` counts cases."""
    scene = case.scene(FIRST_SEED)
    rivals = entrants(case, settings, particles_of(case))
    if not all((TIMES, *case.key, name) in runs for name in rivals):
        for name, row in _scene_times(case, scene, rivals, settings):
            runs.add((TIMES, *case.key, name), origin.stamped(row))
    if case.finer != 1:
        for name in networks(case):
            key = (ALONE, *case.key, name)
            if key not in runs:
                runs.add(key, origin.stamped(_latency_alone(case, scene, name, settings)))
    on_progress(1)


@dataclass(frozen=True, kw_only=True)
class _Truth:
    """The truth of a scene from the frame on from which errors count."""

    start: int
    states: Recording
    """Every tenth state after `start`."""
    grids: TrueGrids

    @classmethod
    def of(cls, case: Case, scene: Scene, settings: CrossingSettings) -> "_Truth":
        # The ground truth's rule knows the cells, not the stiffness: waves are as much quicker as its root.
        by_rule = math.floor(scene.frame_dt * scene.resolution / _REFERENCE_STEP) + 1
        substeps = math.ceil(by_rule * max(1.0, case.stiffer(scene)) ** 0.5)
        solver = MpmSolver(scene, substeps=substeps, threads=settings.threads)
        impact = first_impact(solver, LONGEST_FALL)
        start = max(impact, warm_up(case.scenario))
        solver.advance(start - impact)
        states = after(record(solver, settings.span, every=EVERY), start)
        return cls(
            start=start,
            states=states,
            grids=TrueGrids(states.positions, states.mass, scene.resolution),
        )


def _scene_errors(
    case: Case, scene: Scene, rivals: dict[str, Entrant], settings: CrossingSettings
) -> Iterator[tuple[str, Row]]:
    truth = _Truth.of(case, scene, settings)
    for name, one in rivals.items():
        yield name, {"start": truth.start} | _errors(one, scene, truth, settings)


def _errors(one: Entrant, scene: Scene, truth: _Truth, settings: CrossingSettings) -> Row:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            simulator = one.make(scene, settings.threads)
            simulator.advance(truth.start)
            run = after(record(simulator, settings.span, every=EVERY), truth.start)
        except SimulationError:
            return {"failed": True, "warned": bool(told)}
    inside = np.clip(run.positions, 0, 1)
    by_state = [truth.grids.rmse(row, x, run.mass) for row, x in enumerate(inside)]
    moved = [frame // EVERY - 1 for frame in AT if frame <= settings.span]
    true = truth.states
    transport = metrics.sliced_distance(inside[moved], run.mass, true.positions[moved], true.mass)
    return {
        "failed": False,
        "warned": bool(told),
        "error": significant(float(np.mean(by_state)), 6),
        "transport": significant(float(transport.mean()), 6),
        "simulated": len(simulator.coarse_positions),
    }


def _scene_times(
    case: Case, scene: Scene, rivals: dict[str, Entrant], settings: CrossingSettings
) -> Iterator[tuple[str, Row]]:
    start = first_frame(scene, warm_up(case.scenario))
    timed: dict[str, OwnTiming] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the rows of errors tell of them
        for name, one in rivals.items():
            simulator = one.make(scene, settings.threads)
            try:
                simulator.advance(start)
            except SimulationError:
                yield name, dict.fromkeys(FIELDS)
                continue
            timed[name] = OwnTiming(simulator)
        times = by_turns(list(timed.values()), settings.timed, settings.passes, settings.threads)
    for name, spent in zip(timed, times, strict=True):
        yield name, dict.fromkeys(FIELDS) if spent is None else spent.fields()


def _latency_alone(case: Case, scene: Scene, name: str, settings: CrossingSettings) -> Row:
    """Time steps of a network that moves the same share of the particles as where it was trained."""
    stepper = Enlarged(loaded(name, settings.threads), case.finer)
    latency, _ = step_latency(
        stepper,
        scene,
        earliest=warm_up(case.scenario),
        span=settings.timed,
        threads=settings.threads,
        seconds=_SECONDS,
    )
    return {"ms_per_frame": significant(latency.median if latency else None)}

"""The runner: prepares cases, runs each method on each, and keeps the rows; an interrupted run is resumed."""

import dataclasses
import time
from collections.abc import Sequence as Several
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hybridmpm import scenarios
from hybridmpm.control import (
    Following,
    Keyframe,
    Method,
    Oracle,
    Sketch,
    follow,
    prepare,
    prepare_keyframes,
    reversed_case,
)
from hybridmpm.control.goal.goal import Goal
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.simulator import Simulator
from hybridmpm_lab.control.measures import (
    distance_from_path,
    end_figures,
    features,
    force_figures,
)
from hybridmpm_lab.control.methods import FILLED, NAMES, ORACLE, Methods, methods_of, takes_part
from hybridmpm_lab.control.suite import FAMILIES, VERSION, Case, cases, digest
from hybridmpm_lab.harness.command import scenarios_setting, setting
from hybridmpm_lab.harness.provenance import Provenance, shipped
from hybridmpm_lab.harness.rows import Key, Progress, Row, RowStore, significant
from hybridmpm_lab.harness.timing import Calibration

HORIZON = 100
"""Frames in which reversed cases are led back, as in the paper."""
CAP, ORACLE_CAP = 15.0, 30.0
"""Largest acceleration of a particle, by methods and by the oracle [g]."""
HOLD = 20
"""Frames for which the goal is kept after it was reached."""
_LOOKS = 4  # Frames of each run whose features count for naturalness, at equal distances
MEASURES = (
    "error", "nrmse", "node_error", "transport", "inside", "inside_later", "centroid_error", "path_error",
    "rms_g", "peak_g", "bound_g", "rms_ratio", "handed_over", "plan_ms", "first_frame_ms", "total_ms",
    "slowdown",
)  # fmt: skip
"""Figures of a run, in the order of the rows; each may be None. `run_missing` adds `slowdown`."""
Looks = list[list[float]]
"""Features of some frames (K, 13); empty without a run."""
_NETWORKS = {"learned": "transport", "controlnet": "controlnet"}


@dataclass(frozen=True, kw_only=True)
class ControlSettings:
    """Sketches and methods that are compared."""

    family: tuple[str, ...] = setting(FAMILIES, "Family of the sketches.", FAMILIES)
    scenario: tuple[str, ...] = scenarios_setting()
    seeds: int | None = setting(
        None, "Largest number of sketches of each kind in each family and scenario, else all.", low=1, high=50
    )
    method: tuple[str, ...] = setting(
        NAMES, "A method, or MODULE:ATTRIBUTE for one of your own. The constant force always takes part.", str
    )

    @cached_property
    def cases(self) -> list[Case]:
        """The sketches; raises `ConfigError` where there are none."""
        found = cases(self.family, self.scenario, self.seeds)
        if not found:
            raise ConfigError(
                f"the families {', '.join(self.family)} have no sketches in {', '.join(self.scenario)}: bent "
                "and gather leave out ramps; reversed, shape and sequence have water and sand in 2D and 3D"
            )
        return found

    @cached_property
    def methods(self) -> Methods:
        """The methods by name; raises as `methods_of`."""
        return methods_of(self.method)


def run_store(file: Path | None = None) -> RowStore:
    """Open or create a store of runs; those of another suite, cap or hold are refused."""
    return RowStore({"version": VERSION, "suite": digest(), "cap": CAP, "hold": HOLD}, file)


@dataclass(frozen=True, eq=False)
class Problem:
    """A case made ready: the state that was drawn on, and the known end."""

    case: Case
    simulator: MpmSolver
    """State on which the sketch was drawn; methods get copies."""
    sketch: Sketch | tuple[Keyframe, ...]
    meant: Sketch | tuple[Keyframe, ...]
    """The sketch that runs are judged by; in the family `hand` the one before a hand drew it."""
    truth: npt.NDArray[np.float32] | None = None
    """True positions (N, D) [m] at the end of control; None outside of the reversed family."""
    oracle: Method | None = None

    @property
    def frames(self) -> int | None:
        """Number of frames in which the goal is to be reached; None where it follows from the goal."""
        return None if self.truth is None else HORIZON

    @cached_property
    def goals(self) -> list[Goal]:
        """Goal of the sketch, or of each of several from the state at the start."""
        return self._goals(self.sketch)

    @cached_property
    def judged(self) -> list[Goal]:
        """Goals of the meant sketch."""
        return self._goals(self.meant)

    def _goals(self, sketch: Sketch | tuple[Keyframe, ...]) -> list[Goal]:
        several = [one.goal for one in sketch] if isinstance(sketch, tuple) else [sketch]
        plain: Row = {"method": "none", "frames": self.frames, "gentle": False}
        return [prepare(self.simulator, one, **plain).goal for one in several]


def problem(case: Case) -> Problem:
    """Simulate a case up to its sketch; raises `SimulationError`."""
    if case.family == "reversed":
        found = reversed_case(
            scenarios.get(case.scenario, case.seed),
            control_frame=_control_frame(case.seed),
            frames=HORIZON,
            start="live",
            kind="arrow" if case.kind == "arrow" else "oval",
            cap=ORACLE_CAP,
            substeps="cfl",
        )
        return Problem(case, found.simulator(), found.sketch, found.sketch, found.target, Oracle(found))
    start = case.start()
    solver = MpmSolver(start.scene)
    solver.advance(start.frame)
    return Problem(case, solver, start.sketch, start.meant or start.sketch)


def run(problem: Problem, name: str, method: Method | None) -> tuple[Row, Looks]:
    """Let a method follow the sketch of a case; return its row, and the features of some frames.

    Raises a `ConfigError` where the method is broken: it raised something else than a SimulationError, or its
    law gave no force.
    """
    case = problem.case
    head = {"scenario": case.scenario, "family": case.family, "sketch": case.kind, "seed": case.seed}
    head |= {"bodies": len(problem.simulator.scene.bodies), "method": name}
    looks: Looks = []
    figures: Row = {}
    failed = None
    if name == FILLED:
        ends = [
            end_figures(problem.simulator, judged, problem.truth, goal.paths.places, goal.paths.places)
            for goal, judged in zip(problem.goals, problem.judged, strict=True)
        ]
        figures = _mean(ends)
    else:
        try:
            led = method or problem.oracle or name
            if isinstance(problem.sketch, tuple):
                figures = _followed_in_turn(problem, problem.sketch, name, led)
            else:
                figures, looks = _followed(problem, problem.sketch, name, led)
        except Exception as error:
            # A wrong force raises an error of both kinds.
            if isinstance(error, ConfigError) or not isinstance(error, SimulationError):
                raise ConfigError(
                    f"the method {name} is broken, in {'/'.join(map(str, vars(case).values()))}: "
                    f"{type(error).__name__}: {error}. plan(simulator, task) must return a law, whose "
                    "force(simulator, index) returns None, (D,) or (N, D) in m/s^2"
                ) from error
            failed = str(error)
    rounded = {measure: significant(figures.get(measure)) for measure in MEASURES}
    return head | rounded | {"failed": failed}, looks


def run_missing(
    settings: ControlSettings, store: RowStore, origin: Provenance, on_progress: Progress
) -> None:
    """Run what the store lacks, and add it run by run; `on_progress` counts runs, see `count_missing`.

    `slowdown` of a run is the larger slowdown of the machine before and after it. For scenarios with enough
    reversed cases, looks at uncontrolled scenes are added.

    Raises `ConfigError` as `run`, `SimulationError` as `problem`, and `ExportError` as the store.
    """
    calibration = Calibration(threads=1)
    for case in settings.cases:
        if names := _missing(settings, case, store):
            ready, before = problem(case), calibration.slowdown()
            for name in names:
                row, looks = run(ready, name, settings.methods[name])
                after = calibration.slowdown()
                row |= {"slowdown": significant(max(before, after), 3)}
                file = f"{_NETWORKS.get(name.partition('-')[0])}_{scenarios.describe(case.scenario).dim}d"
                row = origin.using(*({file} & set(shipped()))).stamped(row)
                store.add(run_key(case, name), {"run": row, "looks": looks})
                before = after
                on_progress(1)


def count_missing(settings: ControlSettings, store: RowStore) -> int:
    """Return the number of steps that `run_missing` will count."""
    return sum(len(_missing(settings, case, store)) for case in settings.cases)


def run_key(case: Case, name: str) -> Key:
    """Return the key of a run in the store; its row has `run`, and `looks` (K, 13)."""
    return case.family, case.scenario, case.kind, case.seed, name


def rows_of(cases: Several[Case], methods: Methods, store: RowStore) -> list[Row]:
    """Return the rows of the runs that the store has."""
    keys = (run_key(case, name) for case in cases for name in methods)
    return [store[key]["run"] for key in keys if key in store]


def _missing(settings: ControlSettings, case: Case, store: RowStore) -> list[str]:
    names = [name for name in settings.methods if takes_part(name, case.family)]
    return [name for name in names if run_key(case, name) not in store]


def _followed(problem: Problem, sketch: Sketch, name: str, method: Method | str) -> tuple[Row, Looks]:
    """Return figures, and features of some frames."""
    twin = problem.simulator.copy()
    settings: Row = {"frames": problem.frames, "cap": ORACLE_CAP if name == ORACLE else CAP}
    settings |= {"gentle": False, "hold": HOLD, "seed": problem.case.seed}
    start = time.perf_counter()
    following = follow(twin, sketch, method, **settings)
    guidance, frames = following.guidance, following.guidance.frames
    moments = {-(-frames * part // _LOOKS) for part in range(1, _LOOKS + 1)}
    figures: Row = {"handed_over": float(guidance.method != name), "plan_ms": guidance.planning_ms}
    looks: Looks = []
    for done, _ in enumerate(following, start=1):
        now = time.perf_counter()
        if done == 1:
            figures["first_frame_ms"] = 1000 * (now - start)
        if done == frames:
            figures["total_ms"] = 1000 * (now - start)
        if done in moments:
            looks.append(_look(twin))
            start += time.perf_counter() - now  # A look is no part of the run.
    result = following.result
    end = result.positions[frames]
    figures |= end_figures(twin, problem.judged[0], problem.truth, end, result.positions[-1])
    figures |= force_figures(guidance.goal, [result.force_at(index) for index in range(frames)])
    if problem.case.kind == "arrow":
        figures["path_error"] = distance_from_path(result.centroids[: frames + 1], problem.judged[0].path)
    return figures, looks


def _followed_in_turn(
    problem: Problem, keyframes: tuple[Keyframe, ...], name: str, method: Method | str
) -> Row:
    """Return figures of several goals in turn: means over the goals, each where it is passed."""
    twin = problem.simulator.copy()
    several = [*keyframes[:-1], dataclasses.replace(keyframes[-1], hold=HOLD)]
    start = time.perf_counter()
    sequence = prepare_keyframes(twin, several, method, cap=CAP, gentle=False, seed=problem.case.seed)
    figures: Row = {"plan_ms": sequence.planning_ms}
    passed: list[Row] = []
    forces: list[npt.NDArray[np.float32]] = []
    for done, frame in enumerate(Following(twin, sequence), start=1):
        if done == 1:
            figures["first_frame_ms"] = 1000 * (time.perf_counter() - start)
        forces.append(frame.force)
        if done == sequence.legs[sequence.number].arrival:
            x = frame.positions
            row = end_figures(twin, sequence.goal, None, x, x if done == sequence.frames else None)
            row |= force_figures(sequence.goal, forces) | {"handed_over": float(sequence.method != name)}
            passed.append(row)
            forces = []
    figures["total_ms"] = 1000 * (time.perf_counter() - start)
    later = end_figures(twin, sequence.goal, None, twin.positions, twin.positions)
    return figures | _mean(passed) | {"inside_later": later["inside_later"]}


def _mean(rows: Several[Row]) -> Row:
    """Return the mean of each figure over the rows that have it, the largest of `peak_g`."""
    found: Row = {}
    for name in dict.fromkeys(name for row in rows for name in row):
        values = [row[name] for row in rows if row[name] is not None]
        found[name] = (max if name == "peak_g" else np.mean)(values) if values else None
    return found


def _look(simulator: Simulator) -> list[float]:
    return [float(f"{value:.5g}") for value in features(simulator)]


def _control_frame(seed: int) -> int:
    """Draw the frame at which control starts in a reversed case."""
    return int(np.random.default_rng(seed).integers(HORIZON, 2 * HORIZON, endpoint=True))

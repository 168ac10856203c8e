"""`run`: one entrant on one case."""

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.control import Following, Sketch, follow, prepare
from hybridmpm.control.goal.goal import Goal
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.simulator import Simulator
from hybridmpm_lab.control.entrants import FILLED, ORACLE, Entrant, broken
from hybridmpm_lab.control.measures.end_state import EndStates, distance_from_path
from hybridmpm_lab.control.measures.forces import least_force, measure_forces
from hybridmpm_lab.control.measures.naturalness import features
from hybridmpm_lab.control.suite.problems import ORACLE_CAP, Problem
from hybridmpm_lab.harness.rows import Row, significant

HOLD = 20
"""Frames for which the goal is kept after it was reached."""
CAP = 15.0
"""Largest acceleration of a particle [g]."""
LOOKS = 4
"""Frames of each run that naturalness is judged by, at equal distances."""
MEASURES = (
    "error", "nrmse", "node_error", "transport", "inside", "inside_later", "centroid_error",
    "direction_error", "path_error", "density_ratio", "rms_g", "peak_g", "bound_g", "bound_peak_g",
    "rms_ratio", "peak_ratio", "fine_share", "handed_over", "plan_ms", "first_frame_ms", "total_ms",
    "slowdown",
)  # fmt: skip
"""Figures of a run, in the order of the rows; each may be None. `slowdown` is added by `runner.measure`."""


@dataclass(frozen=True, eq=False)
class Trial:
    """What one entrant did."""

    row: Row
    looks: list[list[float]]
    """Features of some frames, (LOOKS, 13); empty without a run."""
    end: npt.NDArray[np.floating] | None
    """Positions at the end (N, D) [m]; None where it failed."""
    goal: Goal
    """What the sketch asked for."""


def run(problem: Problem, entrant: Entrant) -> Trial:
    """Let an entrant follow the sketch of a case, and measure what came of it.

    Parameters
    ----------
    problem : Problem
    entrant : Entrant

    Raises
    ------
    ConfigError
        The method is broken: it raised something else than a SimulationError, or its law gave no force.
    """
    if entrant.name == FILLED:
        return _filled(problem)
    return _followed(problem, entrant)


def look_at(simulator: Simulator) -> list[float]:
    """Return the features of the present frame (13,), rounded to five digits."""
    scene = simulator.scene
    found = features(
        simulator.positions, simulator.velocities, spacing=scene.spacing, resolution=scene.resolution
    )
    return [float(f"{value:.5g}") for value in found]


def _filled(problem: Problem) -> Trial:
    goal = _goal(problem, problem.sketch)
    places = goal.paths.places
    figures = _end_states(problem, goal).measure(places, places)
    return Trial(_row(problem, FILLED, figures), [], places, goal)


def _followed(problem: Problem, entrant: Entrant) -> Trial:
    method = problem.oracle if entrant.method is None else entrant.method
    if method is None:
        raise ConfigError(f"{entrant.name} takes no part in the family {problem.case.family}")
    name = "/".join(str(one) for one in vars(problem.case).values())
    twin = problem.simulator.copy()
    began = time.perf_counter()
    try:
        following = follow(
            twin,
            problem.sketch,
            method,
            frames=problem.frames,
            cap=ORACLE_CAP if entrant.name == ORACLE else CAP,
            hold=HOLD,
            seed=problem.case.seed,
        )
        spent, looks = _run(following, began)
    except ConfigError as error:
        raise broken(entrant.name, name, error) from error
    except SimulationError as error:
        goal = _goal(problem, problem.sketch)
        return Trial(_row(problem, entrant.name, {"failed": str(error)}), [], None, goal)
    except Exception as error:
        raise broken(entrant.name, name, error) from error
    guidance, result = following.guidance, following.result
    goal, frames = guidance.goal, guidance.frames
    forces = measure_forces(
        result.positions[:frames], [result.force_at(index) for index in range(frames)], goal.cloud.weight
    )
    bound = least_force(goal, frames)
    figures: Row = {
        **_end_states(problem, goal).measure(result.positions[frames], result.positions[-1]),
        **forces,
        **bound,
        "rms_ratio": forces["rms_g"] / bound["bound_g"],
        "peak_ratio": forces["peak_g"] / bound["bound_peak_g"],
        "handed_over": float(guidance.method != entrant.name),
        "plan_ms": guidance.planning_ms,
        **spent,
        "frames": frames,
    }
    if problem.case.kind == "arrow":
        figures["path_error"] = distance_from_path(
            result.centroids[: frames + 1], _judged(problem, goal).path
        )
    return Trial(_row(problem, entrant.name, figures), looks, result.positions[frames], goal)


def _run(following: Following, began: float) -> tuple[Row, list[list[float]]]:
    """Compute all frames; return the times of the sketch's frames, and features of some of them."""
    twin, frames = following.simulator, following.guidance.frames
    looks = []
    moments = {-(-frames * part // LOOKS) for part in range(1, LOOKS + 1)}
    spent: Row = {}
    aside = 0.0
    for done, _ in enumerate(following, start=1):
        now = time.perf_counter()
        if done == 1:
            spent["first_frame_ms"] = 1000 * (now - began)
        if done == frames:
            spent["total_ms"] = 1000 * (now - began - aside)
        if done in moments:
            looks.append(look_at(twin))
            aside += time.perf_counter() - now
    return spent, looks


def _end_states(problem: Problem, goal: Goal) -> EndStates:
    judged = _judged(problem, goal)
    return EndStates(problem.simulator.scene, problem.simulator.mass, judged, problem.truth)


def _goal(problem: Problem, sketch: Sketch) -> Goal:
    return prepare(problem.simulator, sketch, method="none", frames=problem.frames).goal


def _judged(problem: Problem, goal: Goal) -> Goal:
    """Return the goal that was meant: that of the sketch, unless a hand drew it."""
    return goal if problem.meant is problem.sketch else _goal(problem, problem.meant)


def _row(problem: Problem, method: str, figures: Row) -> Row:
    case = problem.case
    return {
        "scenario": case.scenario,
        "family": case.family,
        "sketch": case.kind,
        "seed": case.seed,
        "bodies": problem.bodies,
        "method": method,
        "frames": figures.get("frames", problem.frames),
        **{name: significant(figures.get(name)) for name in MEASURES},
        "failed": figures.get("failed"),
    }

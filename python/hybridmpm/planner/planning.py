"""`plan`: the cheapest coarse level of all ladders within an error, or the most accurate within a time."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import ConfigError
from hybridmpm.planner.calibration import MEASURES, Calibration, MethodErrors
from hybridmpm.planner.candidates import Candidate, candidates
from hybridmpm.planner.cost import milliseconds, warned_of, work
from hybridmpm.planner.likeness import Likeness, likeness
from hybridmpm.planner.store import present
from hybridmpm.scenarios.checked import checked_scene
from hybridmpm.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Prospect:
    """What is expected of a level in a scene."""

    name: str
    """Name of the level, such as "coarse 1/16"; that of its points in docs/results/tradeoff.svg."""
    error: float
    """Mean error over 200 frames from the first impact on, by the measure that was asked for."""
    error_se: float | None
    """Its standard error over the scenes of the calibration."""
    ms_per_frame: float
    """Median time of a frame in mid-splash on one thread, all that is shown counted [ms]."""


@dataclass(frozen=True, kw_only=True)
class Plan(Prospect):
    """A coarse level that was chosen for a scene, with all its settings; `make` builds its simulator."""

    measure: str
    """Measure of the error."""
    feasible: bool
    """Whether the coarse level meets what was asked for; else it is the nearest that there is."""
    simulator: str
    """Kind of the simulator: "mpm", "neural" or "hybrid"."""
    settings: dict[str, Any]
    """Settings of the simulator, besides scene, network and threads."""
    model: str | None
    """Name of the network; None without."""
    r_p: float
    """Share of the particles that are simulated."""
    r_c: float | None
    """Threshold of the cosine guard; None without it."""
    show_all: bool
    """Whether all particles of the scene are carried along with fewer."""
    sleep: bool
    """Whether regions at rest may sleep."""
    particles: int
    """About how many particles are simulated."""
    resolution: int
    """Cells per metre of their grid."""
    substeps: int
    """About how many substeps a frame has in mid-splash."""
    moduli: tuple[float, ...]
    """Factor on the elastic moduli of each material of the scene."""
    runner_up: Prospect | None
    """The next that would have been chosen; None where there is none."""
    reason: str
    """Why this level, in a sentence, and what an impossible demand would take."""
    notes: tuple[str, ...]
    """What the figures rest on, and where the scene differs from those that they were measured in."""
    candidate: Candidate
    """The coarse level itself."""
    scene: Scene
    """The scene that the plan is for."""

    def make(self, threads: int = 1) -> CoarseSimulator:
        """Return the simulator at frame 0; raises and warns as its class does."""
        return self.candidate.make(self.scene, threads)

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as plain data for JSON, without scene and level."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in _OBJECTS}
        sleep = self.settings.get("sleep")
        told = {**self.settings, **({} if sleep is None else {"sleep": sleep.model_dump()})}
        runner_up = None if self.runner_up is None else asdict(self.runner_up)
        lists = {"moduli": list(self.moduli), "notes": list(self.notes)}
        return {**plain, **lists, "settings": told, "runner_up": runner_up}


_OBJECTS = ("candidate", "scene")


def plan(
    scene: Scene,
    *,
    max_error: float | None = None,
    budget_ms: float | None = None,
    measure: str = "grid_rmse",
    calibration: str | Path | None = None,
) -> Plan:
    """Choose the coarse level for a scene: the cheapest within an error, or the most accurate within a time.

    Candidates are MPM with all and with fewer particles, alone, carrying all others, fitted, softer and
    sleeping, each network of the library, and the hybrid with it. What they err was measured against the
    truth (`MpmSolver(scene, substeps="reference")`) in held-out scenes of the seven scenarios; what they take
    is told by the work that the scene makes, on one thread of this machine (`hybridmpm calibrate`).

    Parameters
    ----------
    scene : Scene
    max_error : float > 0, optional
        Largest mean error by the measure; give it or `budget_ms`.
    budget_ms : float > 0, optional
        Longest median time of a frame in mid-splash [ms].
    measure : str
        One of "grid_rmse", "grid_nrmse", "grid_node_error", "transport" [m], "kinetic_energy" and
        "centroid" [m].
    calibration : str or Path, optional
        File of times that `hybridmpm calibrate` wrote; if absent, the user's own, else the one that
        comes with the library. `Plan.notes` tells which.

    Returns
    -------
    Plan
        Where nothing meets the demand, the nearest level, `feasible` is False and `reason` tells what it would
        take.

    Raises
    ------
    ConfigError
        Neither or both of error and time are given, one is not positive and finite, or there is no such
        measure.
    DataError
        The calibration named is missing, damaged or of another machine or solver.
    SceneError
        `scene` is no Scene.

    Warns
    -----
    CalibrationWarning
        The user's own calibration is damaged or foreign.
    """
    checked_scene(scene)
    _check(max_error, budget_ms, measure)
    known, origin = present(None if calibration is None else Path(calibration))
    like = likeness(scene)
    found = list(_prospects(scene, like, known, measure))
    if max_error is not None:
        # Those within the error by their time, then the others by their error.
        found.sort(key=lambda one: (max(one[0].error, max_error), one[0].ms_per_frame))
        feasible = found[0][0].error <= max_error
    else:
        limit = float(budget_ms or 0.0)
        found.sort(key=lambda one: (max(one[0].ms_per_frame, limit), one[0].error, one[0].ms_per_frame))
        feasible = found[0][0].ms_per_frame <= limit
    (best, candidate), runner_up = found[0], found[1][0]
    told = _told(best, like, measure)
    if max_error is not None:
        reason = _for_error(told, runner_up, max_error, feasible=feasible)
    else:
        reason = _for_time(told, runner_up, limit, feasible=feasible)
    speed = max(one.speed for one in known.times.materials if one.dim == scene.dim)
    todo = work(candidate, scene, speed)
    return Plan(
        **asdict(best),
        measure=measure,
        feasible=feasible,
        simulator="mpm" if candidate.method == "coarse" else candidate.method,
        settings=dict(candidate.settings),
        model=candidate.model,
        r_p=candidate.r_p,
        r_c=candidate.settings.get("r_c"),
        show_all=candidate.show_all,
        sleep="sleep" in candidate.settings,
        particles=todo.particles,
        resolution=todo.resolution,
        substeps=todo.substeps,
        moduli=todo.moduli,
        runner_up=runner_up,
        reason=reason,
        notes=(origin, *like.notes, *_below_floor(best, like, known, measure), *warned_of(candidate, scene)),
        candidate=candidate,
        scene=scene,
    )


def prospective(
    scene: Scene, *, measure: str = "grid_rmse", calibration: str | Path | None = None
) -> list[tuple[Prospect, Candidate]]:
    """Return each candidate that a scene allows, with what is expected of it; see `plan`."""
    known, _ = present(None if calibration is None else Path(calibration))
    return list(_prospects(checked_scene(scene), likeness(scene), known, measure))


def _check(max_error: float | None, budget_ms: float | None, measure: str) -> None:
    given = {"max_error": max_error, "budget_ms": budget_ms}
    if (max_error is None) == (budget_ms is None):
        both = "neither" if max_error is None else "both"
        raise ConfigError(f"give max_error or budget_ms, one of the two; got {both}")
    for name, value in given.items():
        if value is None:
            continue
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not (is_number and math.isfinite(value) and value > 0):
            raise ConfigError(f"{name} must be a finite number above 0, got {value!r}")
    if measure not in MEASURES:
        listed = ", ".join(MEASURES)
        raise ConfigError(
            f"measure must be among {listed}; got {measure!r}{did_you_mean(str(measure), MEASURES)}"
        )


def _prospects(
    scene: Scene, like: Likeness, known: Calibration, measure: str
) -> Iterator[tuple[Prospect, Candidate]]:
    """Yield what is expected of each candidate that the scene allows."""
    by_name = [candidates(scenario) for scenario in like.scenarios]
    for name, candidate in by_name[0].items():
        if not all(name in one for one in by_name) or (candidate.model and not like.learned):
            continue
        errors = _errors_of(name, like, known, measure)
        try:
            ms = milliseconds(candidate, scene, known)
        except ConfigError:
            continue  # its grid would be too coarse for the scene
        if errors is not None and ms is not None:
            yield Prospect(name=name, error=errors[0], error_se=errors[1], ms_per_frame=ms), candidate


def _errors_of(
    name: str, like: Likeness, known: Calibration, measure: str
) -> tuple[float, float | None] | None:
    """Return mean and standard error of a candidate, the worst of the scenarios that a scene is like."""
    entries: Sequence[MethodErrors] = [
        one for one in known.errors if one.name == name and one.scenario in like.scenarios
    ]
    means = [
        (one.means[measure], one.standard_errors.get(measure)) for one in entries if measure in one.means
    ]
    return max(means, key=lambda one: one[0]) if len(means) == len(like.scenarios) else None


def _below_floor(best: Prospect, like: Likeness, known: Calibration, measure: str) -> Iterator[str]:
    """Say of an error below the floor what it means."""
    floor = _errors_of("jitter", like, known, measure)
    if floor is not None and best.error < floor[0]:
        yield (
            f"two simulations of such a scene whose particles are jittered otherwise are {floor[0]:.3g} "
            f"apart by {measure}: smaller errors tell how well this very jitter is followed"
        )


def _told(best: Prospect, like: Likeness, measure: str) -> str:
    where = " and ".join(like.scenarios)
    return (
        f"{best.name} errs {best.error:.3g} by {measure} in scenes of {where}, and takes "
        f"{best.ms_per_frame:.3g} ms a frame"
    )


def _for_error(told: str, runner_up: Prospect, max_error: float, *, feasible: bool) -> str:
    if feasible:
        return f"the quickest with an error of at most {max_error:g}: {told}; next comes {_brief(runner_up)}"
    return (
        f"no coarse level errs as little as {max_error:g}; the nearest: {told}. Without error is only the truth "
        'itself, MpmSolver(scene, substeps="reference")'
    )


def _for_time(told: str, runner_up: Prospect, budget_ms: float, *, feasible: bool) -> str:
    if feasible:
        return f"the most accurate within {budget_ms:g} ms: {told}; next comes {_brief(runner_up)}"
    return f"no coarse level takes as little as {budget_ms:g} ms on this machine; the quickest: {told}"


def _brief(one: Prospect) -> str:
    return f"{one.name} with {one.error:.3g} in {one.ms_per_frame:.3g} ms"

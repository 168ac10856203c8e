"""`plan`: the fastest method within an error bound, or the most accurate within a time budget."""

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
from hybridmpm.planner.cost import milliseconds, warnings_of, work
from hybridmpm.planner.matching import MatchingScenarios, matching_scenarios
from hybridmpm.planner.store import present
from hybridmpm.scenarios.checked import checked_scene
from hybridmpm.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Expected error and time of a method in a scene."""

    name: str
    """Name of the method, such as "coarse 1/16"."""
    error: float
    """Mean error over 200 frames from the first impact on, by the chosen measure."""
    error_se: float | None
    """Its standard error over the scenes of the calibration."""
    error_bound: float | None
    """Error that nine of ten such scenes stay below; None where only one scene was measured."""
    ms_per_frame: float
    """Median time of a frame in mid-splash on one thread, all that is shown counted [ms]."""


@dataclass(frozen=True, kw_only=True)
class Plan(Estimate):
    """The method chosen for a scene, with all its settings; `make` builds its simulator."""

    measure: str
    """Measure of the error."""
    feasible: bool
    """Whether the method meets the demand; else it is the nearest that there is."""
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
    """Whether all particles of the scene are shown where fewer are simulated."""
    particles: int
    """Approximate number of particles simulated."""
    resolution: int
    """Cells per metre of their grid."""
    substeps: int
    """Approximate number of substeps of a frame in mid-splash."""
    moduli: tuple[float, ...]
    """Factor on the elastic moduli of each material of the scene."""
    runner_up: Estimate | None
    """The second choice; None where there is none."""
    reason: str
    """Why this method, in a sentence, and what an impossible demand would take."""
    notes: tuple[str, ...]
    """Origin of the figures, and differences of the scene from those of the measurement."""
    candidate: Candidate
    """The method itself."""
    scene: Scene
    """The scene that the plan is for."""

    def make(self, threads: int = 1) -> CoarseSimulator:
        """Return the simulator at frame 0; raises and warns as its class does."""
        return self.candidate.make(self.scene, threads)

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as plain data for JSON, without scene and method."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in _OBJECTS}
        runner_up = None if self.runner_up is None else asdict(self.runner_up)
        lists = {"moduli": list(self.moduli), "notes": list(self.notes)}
        return {**plain, **lists, "runner_up": runner_up}


_OBJECTS = ("candidate", "scene")


def plan(
    scene: Scene,
    *,
    max_error: float | None = None,
    budget_ms: float | None = None,
    measure: str = "grid_rmse",
    calibration: str | Path | None = None,
) -> Plan:
    """Choose the fastest method for a scene within an error bound, or the most accurate within a time budget.

    Candidates are MPM with all and with fewer particles, the coarse mode, softer materials, each network of
    the library, and the hybrid with it. Their errors were measured against the reference
    (`MpmSolver(scene, substeps="reference")`) in held-out scenes of the seven scenarios. Their times come
    from a cost model of the scene on one thread of this machine (`hybridmpm calibrate`).

    Parameters
    ----------
    scene : Scene
    max_error : float > 0, optional
        Error that the scene stays below with a probability of 90 %: largest `error_bound` by the measure.
        A method without a bound does not meet it. Give it or `budget_ms`.
    budget_ms : float > 0, optional
        Time budget: longest median time of a frame in mid-splash [ms].
    measure : str
        One of "grid_rmse", "grid_nrmse", "grid_node_error", "transport" [m], "kinetic_energy" and
        "centroid" [m].
    calibration : str or Path, optional
        File of times that `hybridmpm calibrate` wrote; if absent, the user's own, else the one that
        comes with the library. `Plan.notes` names it.

    Returns
    -------
    Plan
        Where no method meets the demand, the nearest one; `feasible` is then False, and `reason` gives what
        the demand would take.

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
        The user's own calibration is damaged, or of another machine or solver.
    """
    checked_scene(scene)
    _check(max_error, budget_ms, measure)
    known, origin = present(None if calibration is None else Path(calibration))
    matching = matching_scenarios(scene)
    found = list(_estimates(scene, matching, known, measure))
    if max_error is not None:
        # Those within the error by their time, then the others by their error.
        found.sort(key=lambda one: (max(_bound(one[0]), max_error), one[0].ms_per_frame))
        feasible = _bound(found[0][0]) <= max_error
    else:
        limit = float(budget_ms or 0.0)
        found.sort(key=lambda one: (max(one[0].ms_per_frame, limit), one[0].error, one[0].ms_per_frame))
        feasible = found[0][0].ms_per_frame <= limit
    (best, candidate), runner_up = found[0], found[1][0]
    summary = _summary(best, matching, measure)
    if max_error is not None:
        reason = _for_error(summary, runner_up, max_error, feasible=feasible)
    else:
        reason = _for_time(summary, runner_up, limit, feasible=feasible)
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
        particles=todo.particles,
        resolution=todo.resolution,
        substeps=todo.substeps,
        moduli=todo.moduli,
        runner_up=runner_up,
        reason=reason,
        notes=(
            origin,
            *matching.notes,
            *_below_floor(best, matching, known, measure),
            *warnings_of(candidate, scene),
        ),
        candidate=candidate,
        scene=scene,
    )


def estimates(
    scene: Scene, *, measure: str = "grid_rmse", calibration: str | Path | None = None
) -> list[tuple[Estimate, Candidate]]:
    """Return each candidate that a scene allows, with its estimate; see `plan`."""
    known, _ = present(None if calibration is None else Path(calibration))
    return list(_estimates(checked_scene(scene), matching_scenarios(scene), known, measure))


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


def _estimates(
    scene: Scene, matching: MatchingScenarios, known: Calibration, measure: str
) -> Iterator[tuple[Estimate, Candidate]]:
    """Yield each candidate that the scene allows, with its estimate."""
    scene.refuse_rigid("plans are", "errors were measured in scenes without them")
    by_name = [candidates(scenario) for scenario in matching.names]
    for name, candidate in by_name[0].items():
        if not all(name in one for one in by_name) or (candidate.model and not matching.learned):
            continue
        errors = _errors_of(name, matching, known, measure)
        try:
            ms = milliseconds(candidate, scene, known)
        except ConfigError:
            continue  # its grid would be too coarse for the scene
        if errors is not None and ms is not None:
            mean, spread, bound = errors
            found = Estimate(name=name, error=mean, error_se=spread, error_bound=bound, ms_per_frame=ms)
            yield found, candidate


def _errors_of(
    name: str, matching: MatchingScenarios, known: Calibration, measure: str
) -> tuple[float, float | None, float | None] | None:
    """Return mean, standard error and bound of a candidate's error, the worst of the scenarios matching."""
    entries: Sequence[MethodErrors] = [
        one for one in known.errors if one.name == name and one.scenario in matching.names
    ]
    found = []
    for one in (one for one in entries if measure in one.means):
        mean, spread = one.means[measure], one.standard_errors.get(measure)
        # One scene shows nothing of how scenes differ.
        deviation = math.inf if spread is None or one.scenes < 2 else spread * math.sqrt(one.scenes)
        found.append((mean, spread, mean + known.deviations[measure] * deviation))
    if not found or len(found) < len(matching.names):
        return None
    mean, spread, _ = max(found, key=lambda one: one[0])
    bound = max(bound for *_, bound in found)
    return mean, spread, bound if math.isfinite(bound) else None


def _bound(one: Estimate) -> float:
    return math.inf if one.error_bound is None else one.error_bound


def _below_floor(
    best: Estimate, matching: MatchingScenarios, known: Calibration, measure: str
) -> Iterator[str]:
    """Yield a note where the error is below that of two runs with different jitter."""
    floor = _errors_of("jitter", matching, known, measure)
    if floor is not None and best.error < floor[0]:
        yield (
            f"two reference runs of such a scene with different jitter of the particles differ by "
            f"{floor[0]:.3g} ({measure}): smaller errors depend on the jitter"
        )


def _summary(best: Estimate, matching: MatchingScenarios, measure: str) -> str:
    where = " and ".join(matching.names)
    bound = (
        f"without a bound, for one {where} scene was measured"
        if best.error_bound is None
        else f"in nine of ten {where} scenes below {best.error_bound:.3g}"
    )
    return (
        f"{best.name}, expected error ({measure}) {best.error:.3g}, {bound}, and {best.ms_per_frame:.3g} ms "
        "a frame"
    )


def _for_error(summary: str, runner_up: Estimate, max_error: float, *, feasible: bool) -> str:
    if feasible:
        return (
            f"the fastest with an error below {max_error:g} in nine of ten scenes: {summary}; next comes "
            f"{_brief(runner_up)}"
        )
    return (
        f"no method keeps an error of {max_error:g} in nine of ten scenes; the nearest: {summary}. The "
        'reference is MpmSolver(scene, substeps="reference")'
    )


def _for_time(summary: str, runner_up: Estimate, budget_ms: float, *, feasible: bool) -> str:
    if feasible:
        return f"the most accurate within {budget_ms:g} ms: {summary}; next comes {_brief(runner_up)}"
    return f"no method takes at most {budget_ms:g} ms on this machine; the fastest: {summary}"


def _brief(one: Estimate) -> str:
    bound = "no bound" if one.error_bound is None else f"below {one.error_bound:.3g}"
    return f"{one.name} with {one.error:.3g} ({bound}) in {one.ms_per_frame:.3g} ms"

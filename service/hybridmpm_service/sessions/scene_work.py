"""Work on what clients send and receive, made of functions that also run in a process apart (see `apart`)."""

import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import Scene, SceneError, UnknownScenarioError, checking, scenarios
from hybridmpm.checking import Finding, SceneCheck
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner import Estimate, Plan, estimates, plan
from hybridmpm.scene import plain_data
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.admission import building_cost, within_limits
from hybridmpm_service.sessions.solvers import SolverChoice, SolverFactory
from hybridmpm_service.settings import Settings

_SMALL = 5_000_000
"""Building cost of scenes that are built without a trial: it takes some tens of milliseconds."""
_MOST_FAULTS, _MOST_FIELDS = 50, 100
_solvers = cache(SolverFactory)


@dataclass(frozen=True)
class SceneSource:
    """A scene as a client chooses it: a scenario with a seed, or a scene, read already or not."""

    scenario: str | None = None
    seed: int | None = None
    data: Mapping[str, Any] | Scene | None = None

    def scene(self, settings: Settings) -> Scene:
        """Return the scene, within the limits of the settings.

        Raises
        ------
        SceneError
            The scene is not valid, or beyond a limit.
        FieldError
            There is no such scenario.
        """
        if isinstance(self.data, Scene):
            return within_limits(self.data, settings)
        if self.scenario is None:
            return within_limits(read(self.data), settings)
        try:
            return within_limits(scenarios.get(self.scenario, self.seed or 0), settings)
        except UnknownScenarioError as err:
            raise FieldError("body.scenario", str(err).removeprefix("scenario: ")) from None


def value_of(text: bytes) -> Any:
    """Return the value of a JSON text.

    Raises
    ------
    ValueError, RecursionError
        It is no such text, or an object has a key twice, or many more fields than any model.
    """
    value = plain_data.from_json(text)
    waiting = [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, dict):
            # An error for each unknown field would take long to make.
            if len(one) > _MOST_FIELDS:
                raise ValueError(f"an object has {len(one)} fields, and may have at most {_MOST_FIELDS}")
            waiting += one.values()
        elif isinstance(one, list):
            waiting += one
    return value


def read(data: Any) -> Scene:
    """Return the scene of plain data; raises `SceneError`, with the first faults of many."""
    try:
        return Scene.parse(data)
    except SceneError as err:
        raise SceneError.of(err.problems[:_MOST_FAULTS]) from None


def examined(source: SceneSource, settings: Settings) -> tuple[Scene, tuple[Finding, ...]]:
    """Return a scene and its static findings; one that takes too long to build is found out here.

    Raises
    ------
    SceneError, FieldError
        As `SceneSource.scene`; or the scene cannot be filled with particles.
    """
    scene = source.scene(settings)
    if building_cost(scene) > _SMALL:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            MpmSolver(scene)
    return scene, checking.findings(scene)


def checked(source: SceneSource, settings: Settings, choice: SolverChoice) -> SceneCheck:
    """Return the check of a scene for a simulator; errors as `SceneSource.scene` and `SolverFactory.make`."""
    scene = source.scene(settings)
    if choice == SolverChoice() and settings.threads == 1:
        return checking.check(scene)
    solvers = _solvers(threads=settings.threads, folder=settings.models)
    return checking.check_with(scene, lambda: solvers.make(choice, scene, source.scenario).simulator)


def planned(
    source: SceneSource, settings: Settings, demand: Mapping[str, Any]
) -> tuple[Plan, list[Estimate]]:
    """Return the plan for a scene, and the estimates of all methods.

    Parameters
    ----------
    source : SceneSource
    settings : Settings
    demand : mapping
        Other arguments of `hybridmpm.planner.plan`.
    """
    scene = source.scene(settings)
    return plan(scene, **demand), [one for one, _ in estimates(scene, measure=demand["measure"])]


def json_object(values: Mapping[str, Any]) -> bytes:
    """Return numbers, lists and arrays as a JSON object, with null in place of NaN, which JSON lacks."""
    plain = {name: _listed(one) if isinstance(one, np.ndarray) else one for name, one in values.items()}
    return json.dumps(plain, allow_nan=False, separators=(",", ":")).encode()


def _listed(array: npt.NDArray[Any]) -> Any:
    if array.dtype.kind == "f" and (absent := np.isnan(array)).any():
        array = array.astype(object)
        array[absent] = None
    return array.tolist()


def warm_up() -> None:
    """Import and read what the functions of this module need; no thread is started."""
    planned(SceneSource("water_2d", 0), Settings(), {"budget_ms": 1.0, "measure": "grid_rmse"})
    scenarios.get("water_3d", 0).sample()

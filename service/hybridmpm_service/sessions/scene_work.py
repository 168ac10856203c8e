"""Work on scenes of clients, made of functions that also run in a process apart (see `apart`)."""

import warnings
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from hybridmpm import Scene, checking, scenarios
from hybridmpm.checking import Finding, SceneCheck
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner import Estimate, Plan, estimates, plan
from hybridmpm_service.sessions.solvers import SolverChoice, SolverFactory

_solvers = cache(SolverFactory)


def examined(scene: Scene) -> tuple[Finding, ...]:
    """Return the static findings of a scene; build it first, so that one that takes too long is found out.

    Raises
    ------
    SceneError
        The scene cannot be filled with particles.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        MpmSolver(scene)
    return checking.findings(scene)


def checked(
    scene: Scene, scenario: str | None, choice: SolverChoice, threads: int, folder: Path
) -> SceneCheck:
    """Return the check of a scene for a simulator; parameters as in `SolverFactory` and its `make`."""
    if choice == SolverChoice() and threads == 1:
        return checking.check(scene)
    solvers = _solvers(threads=threads, folder=folder)
    return checking.check_with(scene, lambda: solvers.make(choice, scene, scenario).simulator)


def planned(scene: Scene, demand: Mapping[str, Any]) -> tuple[Plan, list[Estimate]]:
    """Return the plan for a scene, and the estimates of all methods.

    Parameters
    ----------
    scene : Scene
    demand : mapping
        Other arguments of `hybridmpm.planner.plan`.
    """
    return plan(scene, **demand), [one for one, _ in estimates(scene, measure=demand["measure"])]


def warm_up() -> None:
    """Import and read what the functions of this module need; no thread is started."""
    planned(scenarios.get("water_2d", 0), {"budget_ms": 1.0, "measure": "grid_rmse"})
    scenarios.get("water_3d", 0).sample()

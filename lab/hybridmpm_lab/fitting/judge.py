"""How a fitted coarse level does on scenes that no search saw: the card of its entry in the table."""

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from hybridmpm import scenarios
from hybridmpm.coarse import CoarseTable, HeldOut, coarse_level
from hybridmpm.coarse.bounds import fastest_impact
from hybridmpm.errors import CoarseWarning
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.harness.rows import FIRST_SEED
from hybridmpm_lab.fitting.cases import Case
from hybridmpm_lab.fitting.outcome import Outcome, measure
from hybridmpm_lab.fitting.space import Target

_SEEN = 1000
"""Number of scenes of a scenario whose speeds are looked at."""
_MARGIN = 1.1
"""Factor on the largest speed among these: other seeds may draw a little more."""


def scenarios_of(target: Target) -> list[str]:
    """Return the scenarios, that of the fit first, in which a target's material appears in its dimension."""
    infos = [scenarios.describe(name) for name in scenarios.NAMES]
    names = [info.name for info in infos if info.dim == target.dim and target.material in info.name]
    return sorted(names, key=lambda name: name != target.scenario)


def fastest(target: Target) -> float:
    """Return the largest speed of an impact in the scenarios of a target [m/s], with a margin."""
    scenes = (scenarios.get(name, seed) for name in scenarios_of(target) for seed in range(_SEEN))
    return _MARGIN * max(fastest_impact(scene) for scene in scenes)


def judge(
    target: Target,
    table: CoarseTable,
    scenario: str,
    *,
    scenes: int,
    folder: Path,
    on_scene: Callable[[], object],
) -> HeldOut:
    """Measure a coarse level of a table on held-out scenes of a scenario, beside the same r_p without fitting.

    Parameters
    ----------
    target : Target
    table : CoarseTable
    scenario : str
    scenes : int >= 2
        Number of scenes, from the first seed of the tests on.
    folder : Path
        Folder of truths; those that are missing are simulated.
    on_scene : callable
        Called after each scene.
    """
    fitted, unfitted, few = [], [], []
    for seed in range(FIRST_SEED, FIRST_SEED + scenes):
        case = Case.of(scenario, seed, folder)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CoarseWarning)  # Frames that are redone are counted.
            level = coarse_level(case.scene, target.name, table)
            fitted.append(measure(case, MpmSolver(case.scene, coarse=level)))
        unfitted.append(measure(case, MpmSolver(case.scene, r_p=target.r_p, show_all=True)))
        few.append(measure(case, MpmSolver(case.scene, r_p=target.r_p)))
        on_scene()
    errors, others = _column(fitted, "error"), _column(unfitted, "error")
    return HeldOut(
        scenario=scenario,
        first_seed=FIRST_SEED,
        scenes=scenes,
        error=_rounded(errors.mean()),
        error_se=_rounded(_standard_error(errors)),
        unfitted=_rounded(others.mean()),
        fitted_minus_unfitted_se=_rounded(_standard_error(errors - others)),
        transport=_rounded(_column(fitted, "transport").mean()),
        transport_few=_rounded(_column(few, "transport").mean()),
        density=_rounded(_column(fitted, "density").max()),
        substeps=_rounded(_column(fitted, "substeps").mean()),
        redone=sum(one.redone for one in fitted),
    )


def _column(outcomes: Sequence[Outcome], name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([getattr(one, name) for one in outcomes], dtype=np.float64)


def _standard_error(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")

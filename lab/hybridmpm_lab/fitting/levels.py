"""`fit_levels`: searches constants of coarse levels, measures them on test scenes, and writes their table."""

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hybridmpm import SOLVER_VERSION, scenarios
from hybridmpm._support.files import replacing
from hybridmpm.coarse import CoarseTable, FittedLevel, HeldOut, coarse_level, coarse_table, fastest_impact
from hybridmpm.errors import CoarseWarning, ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.fitting.cases import Case, Outcome, measure
from hybridmpm_lab.fitting.search import PRICE, search
from hybridmpm_lab.fitting.space import RATIOS, TARGETS, Constants, Target
from hybridmpm_lab.harness.rows import FIRST_SEED, Row, significant
from hybridmpm_lab.harness.settings import setting

LARGEST_COMPRESSION = 0.02
"""Compression of matter at rest up to which moduli are lowered: the settled depth is wrong by as much."""
_FITTED = tuple(dict.fromkeys(target.scenario for target in TARGETS))
_SEEN = 1000  # Number of scenes of a scenario whose speeds are looked at
_MARGIN = 1.1  # Factor on the largest speed among these: other seeds may draw a little more


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Levels that are fitted, and the length of the searches."""

    scenario: tuple[str, ...] = setting(_FITTED, "Scenario: a material in a dimension.", _FITTED)
    coarse: tuple[str, ...] = setting(tuple(RATIOS), "Coarse level.", tuple(RATIOS))
    trials: int = setting(
        80, "Number of points of each search; with 0 the levels of the table are measured anew.", low=0
    )
    scenes: int = setting(10, "Number of training scenes, from seed 0 on.", low=1)
    held_out: int = setting(
        10, "Number of test scenes, half as many of each other scenario with the material.", low=2
    )

    @property
    def targets(self) -> list[Target]:
        """The levels that are fitted."""
        return [one for one in TARGETS if one.scenario in self.scenario and one.name in self.coarse]

    @property
    def steps(self) -> int:
        """Number of calls of `on_step`."""
        return sum(self.trials + sum(self.judged(one).values()) for one in self.targets)

    def judged(self, target: Target) -> dict[str, int]:
        """Return the number of test scenes by scenario."""
        others = max(2, self.held_out // 2)
        return {name: self.held_out if name == target.scenario else others for name in scenarios_of(target)}


def scenarios_of(target: Target) -> list[str]:
    """Return the scenarios with a target's material in its dimension, that of the fit first."""
    infos = [scenarios.describe(name) for name in scenarios.NAMES]
    names = [info.name for info in infos if info.dim == target.dim and target.material in info.name]
    return sorted(names, key=lambda name: name != target.scenario)


def fit_levels(
    settings: FitSettings, *, folder: Path, file: Path, on_step: Callable[[], object]
) -> CoarseTable:
    """Search the constants of coarse levels, and write them into a table with their errors on test scenes.

    The file keeps its levels that are not among the targets, and the constants of a target that no trial
    beats on the training scenes. An interrupted call is resumed with the trial at which it stopped.

    Parameters
    ----------
    settings : FitSettings
    folder : Path
        Folder of the trials and of the truths of scenes; made if it is missing.
    file : Path
        File of the table, JSON.
    on_step : callable
        Called after each trial and after each test scene.

    Raises
    ------
    DataError
        A file of trials or the table is damaged.
    ConfigError
        A file of trials is of another search, or `trials` is 0 and the table lacks a target.
    ExportError
        A file cannot be written.
    """
    truths = folder / "truths"
    truths.mkdir(parents=True, exist_ok=True)
    older = coarse_table(file).entries if file.exists() else ()
    entries = {Target(one.material, one.dim, one.name): one for one in older}
    missing = [target.key for target in settings.targets if target not in entries]
    if settings.trials == 0 and missing:
        raise ConfigError(
            f"{file} has no coarse level {missing[0]} to measure; fit it with at least one trial"
        )
    cases: dict[str, list[Case]] = {}
    for target in settings.targets if settings.trials else ():
        if target.scenario not in cases:
            # Those of one scenario at a time: in 3D they take half a gigabyte.
            seeds = range(settings.scenes)
            cases = {target.scenario: [Case.of(target.scenario, seed, truths) for seed in seeds]}
        known = Constants.of(entries[target]) if target in entries else None
        trials = folder / f"{target.key}.jsonl"
        found = search(target, cases[target.scenario], settings.trials, trials, on_step, known=known)
        constants: Row = {name: significant(value) for name, value in vars(found).items()}
        entries[target] = FittedLevel(
            material=target.material,
            dim=target.dim,
            name=target.name,
            r_p=target.r_p,
            **constants,
            seeds=tuple(range(settings.scenes)),
            trials=settings.trials,
            fastest=significant(_fastest(target)) or 0.0,
            held_out=(),
        )
    table = _table(entries)
    for target in settings.targets:
        seen = []
        for scenario, count in settings.judged(target).items():
            outcomes = []
            for seed in range(FIRST_SEED, FIRST_SEED + count):
                outcomes.append(_outcomes(target, table, Case.of(scenario, seed, truths)))
                on_step()
            seen.append(_held_out(scenario, outcomes))
        entries[target] = entries[target].model_copy(update={"held_out": tuple(seen)})
    table = _table(entries)
    with replacing(file) as part:
        part.write_text(json.dumps(table.model_dump(mode="json"), indent=1) + "\n", encoding="utf-8")
    return table


def _table(entries: Mapping[Target, FittedLevel]) -> CoarseTable:
    return CoarseTable(
        solver_version=SOLVER_VERSION,
        price=PRICE,
        largest_compression=LARGEST_COMPRESSION,
        entries=tuple(entries[target] for target in TARGETS if target in entries),
    )


def _outcomes(target: Target, table: CoarseTable, case: Case) -> tuple[Outcome, Outcome, Outcome]:
    """Run a level of a table, the same r_p without fitting, and its coarse particles alone."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CoarseWarning)  # Frames that are redone are counted.
        level = coarse_level(case.scene, target.name, table)
        fitted = measure(case, MpmSolver(case.scene, coarse=level))
    unfitted = measure(case, MpmSolver(case.scene, r_p=target.r_p, show_all=True))
    return fitted, unfitted, measure(case, MpmSolver(case.scene, r_p=target.r_p))


def _held_out(scenario: str, outcomes: Sequence[tuple[Outcome, Outcome, Outcome]]) -> HeldOut:
    """Return means and standard errors of `_outcomes` of test scenes."""
    fitted, unfitted, plain = zip(*outcomes, strict=True)
    errors, others = (np.array([one.error for one in runs]) for runs in (fitted, unfitted))
    root = np.sqrt(len(outcomes))
    figures = {
        "error": errors.mean(),
        "error_se": errors.std(ddof=1) / root,
        "unfitted": others.mean(),
        "fitted_minus_unfitted_se": (errors - others).std(ddof=1) / root,
        "transport": np.mean([one.transport for one in fitted]),
        "transport_few": np.mean([one.transport for one in plain]),
        "density": max(one.density for one in fitted),
        "substeps": np.mean([one.substeps for one in fitted]),
    }
    rounded: Row = {name: significant(float(value)) for name, value in figures.items()}
    redone = sum(one.redone for one in fitted)
    return HeldOut(scenario=scenario, first_seed=FIRST_SEED, scenes=len(outcomes), redone=redone, **rounded)


def _fastest(target: Target) -> float:
    """Return the largest speed of an impact in the scenarios of a target [m/s], with a margin."""
    scenes = (scenarios.get(name, seed) for name in scenarios_of(target) for seed in range(_SEEN))
    return _MARGIN * max(fastest_impact(scene) for scene in scenes)

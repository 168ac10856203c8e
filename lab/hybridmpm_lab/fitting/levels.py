"""`fit_levels`: searches constants of coarse levels, measures them on test scenes, and writes their table."""

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from hybridmpm import SOLVER_VERSION, scenarios
from hybridmpm._support.files import replacing
from hybridmpm.cli.progress import progress
from hybridmpm.coarse import CoarseTable, FittedLevel, HeldOut, coarse_level, coarse_table, fastest_impact
from hybridmpm.errors import CoarseWarning, ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.compare.truth import Truth
from hybridmpm_lab.fitting.search import PRICE, RATIOS, TARGETS, Constants, Outcome, Target, measure, search
from hybridmpm_lab.harness.command import setting, settings_options
from hybridmpm_lab.harness.rows import FIRST_SEED, Row, significant
from hybridmpm_lab.harness.table import print_table

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

    `folder` has the trials, and is made if it is missing; `file` is that of the table, JSON. `on_step` is
    called after each trial and after each level on a test scene.

    Raises
    ------
    DataError
        A file of trials or the table is damaged.
    ConfigError
        A file of trials is of another search, or `trials` is 0 and the table lacks a target.
    ExportError
        A file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    older = coarse_table(file).entries if file.exists() else ()
    entries = {Target(one.material, one.dim, one.name): one for one in older}
    missing = [target.key for target in settings.targets if target not in entries]
    if settings.trials == 0 and missing:
        raise ConfigError(
            f"{file} has no coarse level {missing[0]} to measure; fit it with at least one trial"
        )
    truths: dict[str, list[Truth]] = {}
    for target in settings.targets if settings.trials else ():
        if target.scenario not in truths:
            # Those of one scenario at a time: in 3D they take half a gigabyte.
            truths = {target.scenario: [_truth(target.scenario, seed) for seed in range(settings.scenes)]}
        known = Constants.of(entries[target]) if target in entries else None
        trials = folder / f"{target.key}.jsonl"
        found = search(target, truths[target.scenario], settings.trials, trials, on_step, known=known)
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
    outcomes: dict[Target, dict[str, list[_Outcomes]]] = {target: {} for target in settings.targets}
    for scenario in dict.fromkeys(name for target in outcomes for name in settings.judged(target)):
        most = max(settings.judged(target).get(scenario, 0) for target in outcomes)
        for index in range(most):
            mine = [one for one in outcomes if index < settings.judged(one).get(scenario, 0)]
            true = _truth(scenario, FIRST_SEED + index)
            for target in mine:
                outcomes[target].setdefault(scenario, []).append(_outcomes(target, table, true))
                on_step()
    for target, seen in outcomes.items():
        held_out = tuple(_held_out(name, seen[name]) for name in settings.judged(target))
        entries[target] = entries[target].model_copy(update={"held_out": held_out})
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


def _truth(scenario: str, seed: int) -> Truth:
    return Truth.of(scenarios.get(scenario, seed))


_Outcomes = tuple[Outcome, Outcome, Outcome]
"""Outcomes of a level, of the same r_p without fitting, and of its coarse particles alone."""


def _outcomes(target: Target, table: CoarseTable, true: Truth) -> _Outcomes:
    scene = true.states.scene
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CoarseWarning)  # Frames that are redone are counted.
        fitted = measure(true, MpmSolver(scene, coarse=coarse_level(scene, target.name, table)))
    unfitted = measure(true, MpmSolver(scene, r_p=target.r_p, show_all=True))
    return fitted, unfitted, measure(true, MpmSolver(scene, r_p=target.r_p))


def _held_out(scenario: str, outcomes: Sequence[_Outcomes]) -> HeldOut:
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


_COLUMNS = (
    "material", "dim", "coarse", "particles_per_cell", "modulus", "cfl", "affine_share", "relaxation",
    "scenario", "error", "error_se", "unfitted", "transport", "transport_few", "density", "substeps",
)  # fmt: skip


@click.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--table",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="JSON file of the levels. Those that it has stay unless this search beats them. Default: "
    "levels.json in FOLDER.",
)
@settings_options(FitSettings)
def fit(settings: FitSettings, folder: Path, file: Path | None) -> None:
    """Fit the constants of coarse levels: grid, moduli, step and upsampling, for each material and dimension.

    FOLDER keeps every trial: an interrupted command is resumed, and with more
    --trials it searches on. Two commands may share a FOLDER if they fit different scenarios into different
    tables. Use a table by MpmSolver(scene, coarse=coarse_level(scene, "1/16", coarse_table(FILE))).
    """
    file = folder / "levels.json" if file is None else file
    if file.parent != folder and not file.parent.is_dir():
        raise click.UsageError(f"--table: the folder {file.parent} does not exist.")
    with progress("Fitting", settings.steps) as bar:
        table = fit_levels(settings, folder=folder, file=file, on_step=lambda: bar.update(1))
    rows = [
        {"coarse": entry.name, **entry.model_dump(exclude={"held_out"}), **seen.model_dump()}
        for entry in table.entries
        for seen in entry.held_out
    ]
    print_table(rows, _COLUMNS)
    click.echo(f"wrote {file}")

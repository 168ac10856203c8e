"""Fitting of coarse levels: the search of their constants, and their table with errors on test scenes."""

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, Self

import click
import numpy as np
import numpy.typing as npt

from hybridmpm import SOLVER_VERSION, scenarios
from hybridmpm._support.files import replacing
from hybridmpm.cli.progress import progress
from hybridmpm.coarse import (
    CoarseLevel,
    CoarseTable,
    FittedLevel,
    HeldOut,
    coarse_level,
    coarse_resolution,
    coarse_table,
    fastest_impact,
)
from hybridmpm.errors import CoarseWarning, ConfigError, SimulationError
from hybridmpm.metrics import sliced_distance
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.truth import Truth, densities
from hybridmpm_lab.harness.command import setting, settings_options
from hybridmpm_lab.harness.rows import EVERY, FIRST_SEED, Row, RowStore, print_table, significant

TRANSPORTED = (9, 19)
"""Rows of the states whose distance of transport counts: 100 and 200 frames after the first impact."""
PRICE = 0.25
"""Exponent of the time in the objective, error * time^PRICE.

From one ratio r_p to the next, halving the time costs 18 to 24 % in error, a factor of 2^0.24 to 2^0.31. So
the lowest objective lies where the Pareto front touches a line of about its own slope.
"""
DENSEST = 1.3
"""Largest density, 99th percentile over that at rest, that is allowed."""
_DENSITY_MARGIN, _TRANSPORT_MARGIN = 0.03, 0.05
"""Distance of a search from the bounds: other runs are longer, and other scenes differ."""
_PENALTY = 4.0  # Weight of violated bounds, in the logarithm of the objective
_GROW, _SHRINK = np.exp(0.8 / 3), np.exp(-0.2 / 3)
"""Factors on the step after a better and after a worse trial: it keeps one trial in five better."""

RATIOS = {"1/64": 1 / 64, "1/32": 1 / 32, "1/16": 1 / 16, "1/8": 1 / 8, "1/4": 1 / 4}
"""Ratios r_p of the coarse levels by name."""

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Target:
    """A coarse level for one material in one dimension."""

    material: Literal["water", "sand"]
    dim: Literal[2, 3]
    name: str

    @property
    def scenario(self) -> str:
        """Scenario whose scenes the coarse level is fitted to."""
        return f"{self.material}_{self.dim}d"

    @property
    def r_p(self) -> float:
        """Ratio of the particles."""
        return RATIOS[self.name]

    @property
    def key(self) -> str:
        """Name of the target, for files."""
        return f"{self.scenario}-{self.name.replace('/', '-')}"


TARGETS = tuple(
    Target(material, dim, name) for material in ("water", "sand") for dim in (2, 3) for name in RATIOS
)

_FEWEST_PER_CELL = 1.0  # Smallest number of particles per cell: with fewer, sand comes apart
_LARGEST_CFL = {"water": 0.65, "sand": 1.0}
"""Largest CFL numbers: those measured to be stable are 0.675 and 1.1."""
_NANOSECONDS = {("water", 2): (18, 57, 21), ("sand", 2): (21, 53, 20)} | {
    ("water", 3): (81, 152, 73),
    ("sand", 3): (44, 141, 71),
}
"""Times on one core of an AMD EPYC: of a coarse particle in a substep and in an upsampling, and of a shown
particle in an upsampling."""
_EVERY = 4  # Frames from one upsampling to the next


@dataclass(frozen=True, kw_only=True)
class Constants:
    """One point of the space."""

    particles_per_cell: float
    modulus: float
    cfl: float
    affine_share: float
    relaxation: float

    @classmethod
    def start(cls, target: Target) -> Self:
        """Return the first point of a search.

        A search by hand led there: moduli are lower by the factor by which cells are wider, in 3D a twelfth
        of water's and a quarter of sand's; at the resolution of the scene they are 0.6.
        """
        per_cell = 1.6 if target.dim == 2 else 1.8
        wider = (target.r_p * 2**target.dim / per_cell) ** (1 / target.dim)
        modulus = wider if target.dim == 2 else {"water": 0.08, "sand": 0.25}[target.material]
        if wider > 1:  # The grid is the scene's own: soft matter would only add to the error.
            modulus = 0.6
        return cls(
            particles_per_cell=per_cell,
            modulus=min(1.0, modulus),
            cfl=0.9 * _LARGEST_CFL[target.material],
            affine_share=0.5,
            relaxation=2.0,
        )

    @classmethod
    def at(cls, target: Target, offset: Floats) -> Self:
        """Return the point at an offset (5,) from the start, clipped to the bounds of the space."""
        start, largest = cls.start(target), _LARGEST_CFL[target.material]
        return cls(
            particles_per_cell=_clipped(start.particles_per_cell * np.exp(offset[0]), _FEWEST_PER_CELL, 6.0),
            modulus=_clipped(start.modulus * np.exp(offset[1]), 0.02, 1.0),
            cfl=_clipped(start.cfl + largest * offset[2], 0.5 * largest, largest),
            affine_share=_clipped(start.affine_share + offset[3], 0.0, 1.0),
            relaxation=_clipped(start.relaxation * np.exp(offset[4]), 0.25, 8.0),
        )

    @classmethod
    def of(cls, entry: FittedLevel) -> Self:
        """Return the constants of a coarse level of a table."""
        return cls(**{field.name: getattr(entry, field.name) for field in fields(cls)})

    def level(self, target: Target, scene: Scene) -> CoarseLevel:
        """Return the coarse level of a scene of the target's scenario, unbounded by depth."""
        return CoarseLevel(
            name=target.name,
            r_p=target.r_p,
            resolution=coarse_resolution(scene, target.r_p, self.particles_per_cell),
            moduli=(self.modulus,),
            cfl=self.cfl,
            affine_share=self.affine_share,
            relaxation=self.relaxation,
        )


SCALE = np.array([0.2, 0.5, 0.1, 0.2, 0.5])
"""First standard deviations of the offsets."""


def _clipped(value: float, low: float, high: float) -> float:
    return float(np.clip(value, low, high))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Errors and costs of a run."""

    error: float
    """grid_rmse, mean over the states [-]."""
    transport: float
    """Sliced Wasserstein distance to the truth [m], mean of the states in `TRANSPORTED`."""
    density: float
    """99th percentile of the density at the shown particles over that at rest, in the last state [-]."""
    substeps: float
    """Substeps of a frame."""
    simulated: int
    """Simulated particles."""
    redone: int
    """Frames that were repeated at the safe step."""


def measure(true: Truth, solver: MpmSolver) -> Outcome:
    """Run a solver at frame 0 over the frames of a truth; raises `SimulationError` where a frame fails."""
    mass, states = solver.mass, true.states
    errors, transports, substeps = [], [], []
    solver.advance(true.impact)
    for row in range(len(states.frames)):
        solver.advance(EVERY)
        x = solver.positions
        errors.append(true.rmse(row, x, mass))
        if row in TRANSPORTED:
            transports.append(float(sliced_distance(x, mass, states.positions[row], states.mass)))
        substeps.append(solver.last_frame.substeps if solver.last_frame else 0)
    return Outcome(
        error=float(np.mean(errors)),
        transport=float(np.mean(transports)),
        density=float(densities(solver.scene, x, mass, solver.materials)),
        substeps=float(np.mean(substeps)),
        simulated=len(solver.coarse_positions),
        redone=len(solver.redone_frames),
    )


def milliseconds(target: Target, outcome: Outcome, shown: int) -> float:
    """Return the time of a frame [ms] by counted work, which does not depend on the load of the machine."""
    substep, spread, gather = _NANOSECONDS[target.material, target.dim]
    upsampling = outcome.simulated * spread + shown * gather
    return 1e-6 * (outcome.substeps * outcome.simulated * substep + upsampling / _EVERY)


def search(
    target: Target,
    truths: Sequence[Truth],
    trials: int,
    file: Path,
    on_trial: Callable[[], object],
    *,
    known: Constants | None = None,
) -> Constants:
    """Search the constants of a coarse level on training scenes.

    The objective is the mean over the scenes of the logarithm of error * time^`PRICE`. Transport above that
    of the coarse particles without upsampling, and density above `DENSEST`, are penalised. The search is a
    (1+1) evolution strategy with the rule of one fifth. On 1800 random quadratic functions with a kink, of
    five numbers, its result after 80 trials is lower than that of CMA-ES in 88 %.

    `truths` are those of the training scenes, `trials` is the number of points that are tried. `file` keeps
    them; those that it has are not repeated. `on_trial` is called after each. `known` are constants of an
    older search, which stay where no trial is better on these scenes.

    Raises
    ------
    ConfigError, DataError
        The file has trials of another search, or is damaged.
    """
    settings = {"solver_version": SOLVER_VERSION, "scenes": [true.states.scene.name for true in truths]}
    store = RowStore(settings | {"target": target.key, "start": vars(Constants.start(target))}, file)
    plain = [measure(true, MpmSolver(true.states.scene, r_p=target.r_p)) for true in truths]
    reached = float(np.mean([one.transport for one in plain]))
    rng, step = np.random.default_rng(1), 1.0
    best, value = np.zeros(len(SCALE)), float("inf")
    for index in range(trials):
        offset = best + (step * SCALE * rng.normal(size=len(SCALE)) if index else 0.0)
        if (index,) not in store:
            store.add((index,), objective(target, Constants.at(target, offset), truths, reached))
        found = store[index,]["value"]
        step *= (_GROW if found < value else _SHRINK) if index else 1.0
        best, value = (offset, found) if found < value else (best, value)
        on_trial()
    old = float("inf") if known is None else objective(target, known, truths, reached)["value"]
    return known if known is not None and old <= value else Constants.at(target, best)


def objective(target: Target, constants: Constants, truths: Sequence[Truth], reached: float) -> Row:
    """Return the `value` of the objective, and means over the truths for a reader of the file."""
    outcomes: list[Outcome] = []
    times = []
    for true in truths:
        scene = true.states.scene
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", CoarseWarning)  # Frames that are redone are counted.
                outcomes.append(measure(true, MpmSolver(scene, coarse=constants.level(target, scene))))
        except SimulationError:
            return {**vars(constants), "value": float("inf")}
        times.append(milliseconds(target, outcomes[-1], len(true.states.mass)))
    errors, transport, density, redone = (
        np.array([getattr(one, name) for one in outcomes], dtype=np.float64)
        for name in ("error", "transport", "density", "redone")
    )
    far = float(transport.mean()) / reached
    violation = float(np.maximum(0.0, density - (DENSEST - _DENSITY_MARGIN)).mean())
    violation += max(0.0, far - (1 - _TRANSPORT_MARGIN)) + 0.1 * float(np.mean(redone > 0))
    value = float(np.mean(np.log(errors) + PRICE * np.log(times))) + _PENALTY * violation
    means = {"error": float(errors.mean()), "ms": float(np.mean(times)), "transport": far}
    return {**vars(constants), "value": value, **means, "density": float(density.mean())}


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
    ConfigError, DataError, ExportError
        A file of trials is of another search, or `trials` is 0 and the table lacks a target; a file is
        damaged; a file cannot be written.
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
        scenes = (scenarios.get(name, seed) for name in scenarios_of(target) for seed in range(_SEEN))
        fastest = _MARGIN * max(map(fastest_impact, scenes))
        entries[target] = FittedLevel(
            material=target.material,
            dim=target.dim,
            name=target.name,
            r_p=target.r_p,
            **constants,
            seeds=tuple(range(settings.scenes)),
            trials=settings.trials,
            fastest=significant(fastest) or 0.0,
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


_COLUMNS = (
    "material", "dim", "coarse", "particles_per_cell", "modulus", "cfl", "affine_share", "relaxation",
    "scenario", "error", "error_se", "unfitted", "transport", "transport_few", "density", "substeps",
)  # fmt: skip


@click.command(params=settings_options(FitSettings))
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--table",
    "file",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="JSON file of the levels. Those that it has stay unless this search beats them. Default: "
    "levels.json in FOLDER.",
)
def fit(*, folder: Path, file: Path | None, **values: Any) -> None:
    """Fit the constants of coarse levels: grid, moduli, step and upsampling, for each material and dimension.

    FOLDER keeps every trial: an interrupted command is resumed, and with more
    --trials it searches on. Two commands may share a FOLDER if they fit different scenarios into different
    tables. Use a table by MpmSolver(scene, coarse=coarse_level(scene, "1/16", coarse_table(FILE))).
    """
    settings = FitSettings(**values)
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

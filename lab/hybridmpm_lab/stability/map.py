"""The stability map: each method under each stress at three levels, and its outcome."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.hybrid.guards import GUARDS
from hybridmpm.metrics import other_jitter
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import as_stepper
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.simulator import Simulator
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.store import RowStore
from hybridmpm_lab.stability.corrupted import Corrupted
from hybridmpm_lab.stability.outcome import OUTCOMES, Outcome, Run, judged, look
from hybridmpm_lab.stability.stresses import STRESSES, Method, Trial

JITTERS = 3
"""Runs of the truth with other jitter, whose volumes measure the chance in a trial."""
MODELS = {2: "fluids_2d", 3: "fluids_3d"}
"""Networks of the map by dimension; both move an eighth of the particles, and all are shown."""
COARSE = "1/16"
"""Level of the coarse mode."""
_EVERY = 4  # frames between two measurements of a state
_SAFE_CFL = 0.25  # CFL number of the truth where the ground truth's own substeps do not hold


class Cell(NamedTuple):
    """One cell of the map."""

    method: Method
    material: str
    dim: int
    stress: str
    level: str

    @property
    def trial(self) -> Trial:
        """Scene and stress of this cell."""
        stress = STRESSES[self.stress]
        values = {stress.unit.format(value): value for value in stress.levels}
        return stress.trial(self.material, self.dim, values[self.level])


class Attempt(NamedTuple):
    """Result of a method on a trial."""

    run: Run | None
    """None where it did not come to its end."""
    signals: tuple[str, ...]
    """Errors, warnings and alarms for the user, by name, each once."""
    refused: bool = False
    """Whether it was refused before any frame."""


def cells(names: Sequence[str] = ()) -> list[Cell]:
    """Return the cells of some stresses, or of all, those of one scene together."""
    return [
        Cell(method, material, dim, name, stress.unit.format(value))
        for name, stress in STRESSES.items()
        if not names or name in names
        for material, dim in stress.settings
        for value in stress.levels
        for method in stress.methods
    ]


def measure(todo: Sequence[Cell], runs: RowStore, origin: Provenance, on_progress: Progress) -> Iterator[Row]:
    """Run the cells that are missing, adding each to the runs, and yield all rows.

    `on_progress` counts cells. `signalled` names the errors, warnings and alarms for the user, None without
    any. `against` names the measures that speak against survival.
    """
    scenes: dict[tuple[object, ...], list[Cell]] = {}
    for cell in todo:
        scenes.setdefault(cell[1:], []).append(cell)
    for mine in scenes.values():
        missing = [cell for cell in mine if cell not in runs]
        if missing:
            trial = missing[0].trial
            true, *others = (truth(trial, shift=shift) for shift in range(1 + JITTERS))
        for cell in missing:
            made = attempt(trial, cell.method)
            faults: list[str] = []
            outcome: Outcome = "refused" if made.refused else "failed"
            if made.run is not None:
                outcome, faults = judged(made.run, true, others, all_simulated=cell.method == "mpm")
            row: Row = cell._asdict() | {
                "outcome": outcome,
                "against": ", ".join(faults) or None,
                "signalled": ", ".join(made.signals) or None,
                "threads": 1,
            }
            runs.add(cell, origin.using(*_ingredients(cell)).stamped(row))
        on_progress(len(mine))
    for cell in todo:
        yield runs[cell]


def _ingredients(cell: Cell) -> tuple[str, ...]:
    return {"mpm": (), "coarse": ("levels",)}.get(cell.method, (MODELS[cell.dim],))


def counted(rows: Sequence[Row]) -> list[Row]:
    """Return a row for each method with the number of cells by outcome.

    `silent` counts degraded and failed cells without any signal to the user.
    """
    counts: dict[str, Row] = {}
    for row in rows:
        name = row["method"]
        mine = counts.setdefault(name, {"method": name, **dict.fromkeys(OUTCOMES, 0), "silent": 0})
        mine[row["outcome"]] += 1
        mine["silent"] += row["outcome"] in ("degraded", "failed") and not row["signalled"]
    return list(counts.values())


def attempt(trial: Trial, method: Method) -> Attempt:
    """Run a method on a trial to its end, to an error or to a refusal."""
    run = None
    errors: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            simulator = _simulator(trial, method)
        except (ConfigError, SimulationError) as error:
            return Attempt(None, (type(error).__name__,), refused=True)
        try:
            run = _driven(trial, simulator, lambda: _simulator(trial, method))
        except SimulationError as error:
            if simulator.frame == 0:
                return Attempt(None, (type(error).__name__,), refused=True)
            errors.append(type(error).__name__)
    warned = [one.category.__name__ for one in caught if issubclass(one.category, UserWarning)]
    alarms = [
        f"{one.reason} alarm"
        for one in simulator.log
        if one.mode == "mpm" and one.reason in (*GUARDS, "unsound")
    ]
    return Attempt(run, tuple(dict.fromkeys(errors + warned + alarms)))


def truth(trial: Trial, *, shift: int = 0) -> Run | None:
    """Run MPM with all particles, at the ground truth's substeps and a stiffness that is safe.

    Where those do not hold, at a CFL number far below the limit; None where that fails, too. `shift` gives
    the particles another jitter.
    """
    scene = other_jitter(trial.safe or trial.scene, shift)
    plain = replace(trial, resume_at=None)
    for settings in ({"substeps": "reference"}, {"cfl": _SAFE_CFL}):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return _driven(plain, MpmSolver(scene, **settings), None)
            except (ConfigError, SimulationError):
                continue
    return None


def _simulator(trial: Trial, method: Method) -> Simulator:
    settings: dict[str, Any] = dict(trial.mpm)
    if method == "coarse":
        by_step = {"cfl", "substeps"} & set(settings)
        settings |= {"r_p": 1 / 16, "show_all": True} if by_step else {"coarse": COARSE}
    if method in ("mpm", "coarse"):
        return MpmSolver(trial.scene, **settings)
    network = as_stepper(MODELS[trial.scene.dim], trial.scene)
    if method == "neural":
        return NeuralPhysics(trial.scene, network)
    if trial.corruption is not None:
        network = Corrupted(network, trial.corruption, trial.scene)
    return HybridSimulator(trial.scene, network)


def _driven(trial: Trial, simulator: Simulator, make: Callable[[], Simulator] | None) -> Run:
    """Advance to the end of a trial, and measure the state every few frames."""
    looks, work, passed = [look(simulator, 0.0)], 0.0, 0.0
    works = trial.force is not None or any(one.motion for one in trial.scene.obstacles)
    twin: Simulator | None = None
    for frame in range(trial.frames):
        if frame == trial.resume_at and make is not None:
            twin = make()
            twin.restore(simulator.snapshot())
        force = None if trial.force is None else trial.force(simulator)
        before = simulator.positions
        simulator.advance(1, force)
        if twin is not None:
            twin.advance(1, force)
        if works:
            work += _work(simulator, before, force)
        if (frame + 1) % _EVERY == 0:
            looks.append(look(simulator, work))
            if trial.behind is not None:
                passed = max(passed, float(trial.behind(simulator.positions).mean()))
            if not looks[-1].finite:
                break
    mass = float(simulator.mass.sum(dtype=np.float64))
    return Run(tuple(looks), mass, passed, twin is None or _same(simulator, twin))


def _work(simulator: Simulator, before: npt.NDArray[np.float32], force: npt.ArrayLike | None) -> float:
    """Return the work of a force, constant over a frame, and of moving obstacles [J]."""
    report = simulator.last_frame
    work = 0.0 if report is None else report.obstacle_work
    if force is not None:
        moved = simulator.positions.astype(np.float64) - before
        work += float(simulator.mass @ (moved * np.asarray(force)).sum(axis=1))
    return work


def _same(one: Simulator, two: Simulator) -> bool:
    return np.array_equal(one.positions, two.positions) and np.array_equal(one.velocities, two.velocities)

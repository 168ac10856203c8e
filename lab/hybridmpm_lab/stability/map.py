"""The stability map: the outcome of each method under each stress at three levels."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import click
import numpy as np
import numpy.typing as npt
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hybridmpm.checking import findings
from hybridmpm.cli.progress import progress
from hybridmpm.coarse.splines import Stencils
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.hybrid.guards import GUARDS
from hybridmpm.metrics import other_jitter
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import as_stepper
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator
from hybridmpm_lab.harness import charts
from hybridmpm_lab.harness.command import Measurement, runs_option, setting
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Row, RowStore, print_table
from hybridmpm_lab.stability.stresses import STRESSES, Corrupted, Method, Trial

Outcome = Literal["survived", "refused", "degraded", "failed"]
COLOURS: dict[Outcome, str] = {
    "survived": "#dbe9f1", "refused": "#9aa5ad", "degraded": "#e3a857", "failed": "#7f1d1d"
}  # fmt: skip
"""Colours of the outcomes; a grey print keeps their order, apart from what is refused, which has a sign."""
SIGNS: dict[Outcome, str] = {"survived": ".", "refused": "x", "degraded": "d", "failed": "F"}
TITLES = {"mpm": "MPM", "coarse": "coarse 1/16, all shown", "neural": "network", "hybrid": "hybrid"}
"""Names of methods in charts and tables."""

ENERGY_GROWTH = 1.05
"""Largest energy of a run that survives, over that at the start and the work done."""
DENSITY_GROWTH = 1.1
"""Largest crowding of a run that survives, over the truth's, where all particles are simulated."""
SHOWN_DENSITY_GROWTH = 1.3
"""The same for shown particles, which follow coarse ones."""
VOLUME_CHANGE = 0.05
"""Largest difference of the volume of a run that survives to the truth's, in the last quarter."""
_PASSED = 0.001  # share of the particles that may pass a solid
_REST_ENERGY = 1e-3  # energy that is neglected [J/kg]: that of a speed of 4.5 cm/s, or a height of 0.1 mm
_QUARTERS = 4
JITTERS = 3
"""Runs of the truth with other jitter, whose volumes measure the chance in a trial."""
MODELS = {2: "fluids_2d", 3: "fluids_3d"}
"""Networks of the map by dimension; both move an eighth of the particles, and all are shown."""
COARSE = "1/16"
"""Level of the coarse mode."""
_EVERY = 4  # frames between two measurements of a state
_SAFE_CFL = 0.25  # CFL number of the truth where the ground truth's own substeps do not hold

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Look:
    """The measures of one state."""

    finite: bool
    outside: int
    """Particles more than a cell past a wall."""
    energy: float
    """Kinetic and potential energy above that of all mass at the lowest corner, of MPM also elastic [J]."""
    work: float
    """Work that forces and moving obstacles have done since the start [J]."""
    crowding: float
    """Volume of the particles at rest over the room that they take, which one in a hundred exceeds [-]."""
    volume: float
    """Volume that the matter takes, by the cells that it fills [m^D]."""


def look(simulator: Simulator, work: float) -> Look:
    """Measure the present state of a simulator, given the work done so far [J]."""
    scene, x, v = simulator.scene, simulator.positions, simulator.velocities
    if not (np.isfinite(x).all() and np.isfinite(v).all()):
        return Look(finite=False, outside=0, energy=0.0, work=work, crowding=0.0, volume=0.0)
    lower, upper = np.array(scene.walls.lower) - scene.dx, np.array(scene.walls.upper) + scene.dx
    crowding, volume = _room(scene, np.clip(x, 0, 1))
    return Look(
        finite=True,
        outside=int(((x < lower) | (x > upper)).any(axis=1).sum()),
        energy=_energy(simulator, x, v),
        work=work,
        crowding=crowding,
        volume=volume,
    )


def _energy(simulator: Simulator, x: _Floats, v: _Floats) -> float:
    scene, mass = simulator.scene, simulator.mass.astype(np.float64)
    gravity = np.array(scene.gravity)
    lowest = np.maximum(gravity * scene.walls.lower, gravity * scene.walls.upper).sum()
    by_mass = 0.5 * (v.astype(np.float64) ** 2).sum(axis=1) + lowest - x.astype(np.float64) @ gravity
    elastic = simulator.diagnostics().elastic_energy if simulator.r_p == 1 else 0.0
    return float(mass @ by_mass) + elastic


def _room(scene: Scene, x: _Floats) -> tuple[float, float]:
    """Return crowding and volume; all particles of a scene have the same volume at rest.

    A cell counts as a whole from three quarters full on, and not at all below one quarter. With a jump at one
    half, a plane surface would gain or lose a layer of cells at once, and without a slope no void would show.
    """
    stencils = Stencils.at(x.astype(np.float64), scene.resolution, scene.cells)
    share = (scene.spacing / scene.dx) ** scene.dim
    filled = stencils.scatter(np.full(len(x), share))
    cells = float(np.clip(2 * filled - 0.5, 0, 1).sum())
    return float(np.percentile(stencils.gather(filled), 99)), cells * scene.dx**scene.dim


@dataclass(frozen=True)
class Run:
    """One method on one trial, up to its end."""

    looks: tuple[Look, ...]
    mass: float
    """Mass of all particles [kg]."""
    passed: float = 0.0
    """Largest share of the particles that can be reached only through a solid."""
    same: bool = True
    """Whether a run from a snapshot gave the same bits."""

    def crowding(self) -> npt.NDArray[np.float64]:
        """Return the mean crowding of each quarter of the run."""
        parts = np.array_split(np.array([one.crowding for one in self.looks[1:]]), _QUARTERS)
        return np.array([part.mean() for part in parts])

    def volume(self) -> float:
        """Return the mean volume in the last quarter of the run [m^D]."""
        last = len(self.looks) - (len(self.looks) - 1) // _QUARTERS
        return float(np.mean([one.volume for one in self.looks[last:]]))


def judged(
    run: Run, truth: Run | None, others: Sequence[Run | None] = (), *, all_simulated: bool
) -> tuple[Outcome, list[str]]:
    """Return the outcome of a complete run, and the measures that speak against survival.

    `others` are the truth with other jitter. Where their volumes differ by more than is allowed, the motion
    is chaotic, and a run may differ by as much. Without a truth the state at the start takes its place.
    """
    finite = all(one.finite for one in run.looks)
    if not finite or any(one.outside for one in run.looks):
        return "failed", ["outside" if finite else "not finite"]
    faults = []
    start = run.looks[0]
    allowed = [ENERGY_GROWTH * (start.energy + one.work) + _REST_ENERGY * run.mass for one in run.looks]
    if any(one.energy > most for one, most in zip(run.looks, allowed, strict=True)):
        faults.append("energy")
    # Below 1 matter is apart: where a particle lies within its cell is no crowding.
    crowding = np.maximum(truth.crowding() if truth else np.full(_QUARTERS, start.crowding), 1.0)
    growth = DENSITY_GROWTH if all_simulated else SHOWN_DENSITY_GROWTH
    if (run.crowding() > growth * crowding).any():
        faults.append("density")
    volume = truth.volume() if truth else start.volume
    spread = max((abs(one.volume() - volume) for one in others if truth and one), default=0.0)
    if abs(run.volume() - volume) > max(VOLUME_CHANGE * volume, spread):
        faults.append("volume")
    if run.passed > _PASSED:
        faults.append("passed a solid")
    if not run.same:
        faults.append("another state than the uninterrupted run")
    return ("degraded" if faults else "survived"), faults


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
    """Errors, warnings, alarms and `check` for the user, by name, each once."""
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


@dataclass(frozen=True)
class _Settings:
    stress: tuple[str, ...] = setting((), "Stress of the map; all if absent.", tuple(STRESSES))


def measure(settings: _Settings, origin: Provenance, runs_file: Path | None) -> list[Row]:
    """Run the cells that a file of runs lacks, and return all rows.

    `signalled` names the errors, warnings and alarms for the user, and `check`, None without any. `against`
    names the measures that speak against survival.
    """
    todo, runs = cells(settings.stress), RowStore({}, runs_file)
    scenes: dict[tuple[object, ...], list[Cell]] = {}
    for cell in todo:
        scenes.setdefault(cell[1:], []).append(cell)
    with progress("Measuring", len(todo)) as bar:
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
                used = {"mpm": (), "coarse": ("levels",)}.get(cell.method, (MODELS[cell.dim],))
                runs.add(cell, origin.using(*used).stamped(row))
            bar.update(len(mine))
    return [runs[cell] for cell in todo]


def attempt(trial: Trial, method: Method) -> Attempt:
    """Run a method on a trial to its end, to an error or to a refusal.

    The check of its scene is a signal to users of MPM, where it warns: it is about the solver.
    """
    run = None
    errors: list[str] = []
    checked = method in ("mpm", "coarse") and any(one.severity != "note" for one in findings(trial.scene))
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
    return Attempt(run, tuple(dict.fromkeys(errors + warned + alarms + ["check"] * checked)))


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
    same = twin is None or (
        np.array_equal(simulator.positions, twin.positions)
        and np.array_equal(simulator.velocities, twin.velocities)
    )
    return Run(tuple(looks), mass, passed, same)


def _work(simulator: Simulator, before: npt.NDArray[np.float32], force: npt.ArrayLike | None) -> float:
    """Return the work of a force, constant over a frame, and of moving obstacles [J]."""
    report = simulator.last_frame
    work = 0.0 if report is None else report.obstacle_work
    if force is not None:
        moved = simulator.positions.astype(np.float64) - before
        work += float(simulator.mass @ (moved * np.asarray(force)).sum(axis=1))
    return work


def draw(rows: Sequence[Row], file: Path) -> None:
    """Draw the map; a dot in a cell is a signal to the user."""
    stresses = list(dict.fromkeys(row["stress"] for row in rows))
    settings = list(dict.fromkeys((row["material"], row["dim"]) for row in rows))
    methods = [method for method in TITLES if any(row["method"] == method for row in rows)]
    figure, (axes,) = charts.panels(len(methods), width=3.0, height=1.2 + 0.3 * len(stresses))
    for axis, method in zip(axes, methods, strict=True):
        placed: dict[tuple[str, str, int], int] = {}
        for row in (row for row in rows if row["method"] == method):
            key = row["stress"], row["material"], row["dim"]
            placed[key] = step = placed.get(key, 0) + 1
            place, line = 3.4 * settings.index(key[1:]) + step, stresses.index(row["stress"])
            ink = "white" if row["outcome"] == "failed" else "black"
            axis.bar(place, 0.86, 0.92, bottom=line - 0.43, color=COLOURS[row["outcome"]])
            if row["outcome"] != "survived":
                axis.text(place, line, SIGNS[row["outcome"]], ha="center", va="center", fontsize=7, color=ink)
            if row["signalled"]:
                axis.plot(place + 0.3, line - 0.27, ".", markersize=3, color=ink)
        labels = [f"{material}\n{dim}D" for material, dim in settings]
        axis.set_xticks([3.4 * column + 2 for column in range(len(settings))], labels, fontsize=8)
        axis.set_yticks(range(len(stresses)), stresses if axis is axes[0] else [])
        axis.set_ylim(len(stresses) - 0.5, -0.5)
        axis.set_title(TITLES[method], fontsize=9)
        axis.grid(visible=False)
        axis.tick_params(length=0)
    keys: list[Any] = [
        Patch(color=colour, label=f"{name} ({SIGNS[name]})") for name, colour in COLOURS.items()
    ]
    keys.append(Line2D([], [], color="black", marker=".", linestyle="", label="a signal to the user"))
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
    charts.save(figure, file)


def _show(rows: Sequence[Row]) -> None:
    """Print a line for each stress and setting, and the number of cells of each method by outcome."""
    lines: dict[tuple[str, str], dict[str, str]] = {}
    counts = {
        name: dict.fromkeys((*SIGNS, "silent"), 0) for name in dict.fromkeys(row["method"] for row in rows)
    }
    for row in rows:
        method, outcome = row["method"], row["outcome"]
        setting = row["stress"], f"{row['material']} {row['dim']}D"
        silent = outcome in ("degraded", "failed") and not row["signalled"]
        lines.setdefault(setting, dict.fromkeys(TITLES, ""))[method] += SIGNS[outcome] + "!" * silent
        counts[method][outcome] += 1
        counts[method]["silent"] += silent
    table = [{"stress": stress, "setting": setting} | line for (stress, setting), line in lines.items()]
    print_table(table, ("stress", "setting", *TITLES))
    click.echo(". survived, x refused, d degraded, F failed, ! without a signal to the user\n")
    print_table([{"method": name} | mine for name, mine in counts.items()], ("method", *SIGNS, "silent"))


stability = Measurement(
    name="stability",
    settings=_Settings,
    measure=measure,
    draw=draw,
    show=_show,
    options=(runs_option,),
    summary="""Find the scenes that each method survives.

    MPM, the coarse mode, the network and the hybrid run under each stress at three levels. A letter for each
    level shows the outcome; an exclamation mark follows where the user gets no signal.
    """,
).command()

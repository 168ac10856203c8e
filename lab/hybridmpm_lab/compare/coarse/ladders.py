"""What fewer particles cost and save when only MPM runs: alone, carrying all others, and fitted to do so."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hybridmpm import metrics, scenarios
from hybridmpm.coarse import coarse_table
from hybridmpm.mpm import MpmSolver
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.accuracy.conventions import AT, EVERY, FIRST_SEED, LADDER
from hybridmpm_lab.compare.accuracy.rollouts import Truth, excerpt, frozen
from hybridmpm_lab.compare.coarse.frame_times import FrameTimes, frame_times
from hybridmpm_lab.harness.pareto import dominating
from hybridmpm_lab.harness.rows import Progress, Row, significant

RATIOS = LADDER
"""Ratios r_p by label."""
_GRID = {"error": "grid_rmse", "grid_nrmse": "grid_nrmse", "grid_node_error": "grid_node_error"}
"""Readings of the grid error, by their fields: those that single frames have, too."""
_MEANS = ("kinetic_energy", "mechanical_energy", "centroid", "max_density")
"""What is reported as a mean over the states, as `metrics.compare` names it."""
_BOUNDS = ("jitter", "still", "merged")
"""Methods that are floors and ceilings of the error: nobody can run them."""
_TRANSPORTED = (100, 200)
"""Frames after the first impact whose distance of transport counts."""


@dataclass(frozen=True, kw_only=True)
class DownsamplingSettings:
    """Scenes, length and repetitions of the measurement."""

    scenarios: tuple[str, ...] = ("water_2d", "sand_2d", "water_3d", "sand_3d")
    """Scenarios that the scenes are drawn from."""
    scenes: int = 10
    """Number of scenes of each scenario."""
    frames: int = 200
    """Number of frames of each scene after its first impact."""
    repeats: int = 9
    """Number of timings of each method; the lower quartile counts."""

    @property
    def count(self) -> int:
        """Number of scenes in all."""
        return self.scenes * len(self.scenarios)


def measure(settings: DownsamplingSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure each scenario and yield a row for each method and r_p; `on_progress` counts scenes.

    The truth is MPM with all particles and the ground truth's substeps. The methods are `mpm`, merged
    particles on a coarse grid at CFL substeps; `carried`, which carries all particles of the scene along;
    `fitted`, which does so at a coarse level of the table. Bounds stand beside them: `merged`, the truth merged state
    by state, the floor of whoever shows so few particles; `jitter`, the truth with other jitter, the floor of
    all; `still`, the state of the first impact held, the ceiling.

    `error` is the mean of `grid_rmse` over every tenth state after the first impact, `error_40` that of one
    frame; `grid_nrmse` and `grid_node_error` are the same for these readings of the grid error.
    `kinetic_energy`, `mechanical_energy`, `centroid` [m] and `max_density` are means over the states of what
    `metrics.compare` measures. `transport` is the sliced Wasserstein distance [m], a mean of two states,
    `density` the largest 99th percentile of the density at the particles over that at rest in the last state.
    Fields ending in `_se` are standard errors over the scenes. `minus_mpm`, `minus_carried`,
    `transport_minus_mpm` are mean differences on the same scenes to the method of that name with the same
    r_p. Times are those of the scenario's reference scene.
    """
    for scenario in settings.scenarios:
        table, facts = metrics.ErrorTable(), _Facts()
        for seed in range(FIRST_SEED, FIRST_SEED + settings.scenes):
            _run_scene(scenarios.get(scenario, seed), settings, table, facts)
            on_progress(1)
        methods = [name for name in table.methods if not _is_bound(name)]
        times = frame_times(scenario, {name: _maker(name) for name in methods}, settings.repeats)
        head = {"scenario": scenario, "scenes": settings.scenes}
        rows = [head | _row(name, table, facts, times.get(name)) for name in table.methods]
        rivals = [row for row in rows if row["method"] not in _BOUNDS]
        for row in rows:
            better = dominating(row, rivals)
            yield row | {"dominated_by": better and f"{better['method']} {better['label']}"}


@dataclass
class _Facts:
    """What is known of each method besides its errors; lists over the scenes, by method."""

    particles: dict[str, list[int]] = dataclasses.field(default_factory=dict)
    resolution: dict[str, list[int]] = dataclasses.field(default_factory=dict)
    density: dict[str, list[float]] = dataclasses.field(default_factory=dict)
    redone: dict[str, int] = dataclasses.field(default_factory=dict)

    def enter(self, name: str, solver: MpmSolver, density: float) -> None:
        self.particles.setdefault(name, []).append(len(solver.coarse_positions))
        self.resolution.setdefault(name, []).append(solver.resolution)
        self.density.setdefault(name, []).append(density)
        self.redone[name] = self.redone.get(name, 0) + len(solver.redone_frames)


class _Maker:
    """Makes the solver of a method by its name."""

    def __init__(self, kind: str, label: str) -> None:
        self._kind, self._label = kind, label

    def __call__(self, scene: Scene) -> MpmSolver:
        if self._kind == "fitted":
            return MpmSolver(scene, coarse=self._label)
        return MpmSolver(scene, r_p=RATIOS[self._label], show_all=self._kind == "carried")


def _is_bound(name: str) -> bool:
    return name.partition(" ")[0] in _BOUNDS


def _maker(name: str) -> _Maker:
    kind, _, label = name.partition(" ")
    return _Maker(kind, label)


def _names() -> Iterator[str]:
    """Yield the names of the methods: kind and label of r_p."""
    for label, r_p in RATIOS.items():
        yield f"mpm {label}"
        if r_p < 1:
            yield f"carried {label}"
        if label in coarse_table().ratios:
            yield f"fitted {label}"


def _run_scene(
    scene: Scene, settings: DownsamplingSettings, table: metrics.ErrorTable, facts: _Facts
) -> None:
    """Enter the errors of all methods in a scene."""
    span = settings.frames
    truth = Truth.of(scene, latest_warm_up=0, span=span)
    true = excerpt(truth.states, truth.impact, span)
    jittered = truth.with_other_jitter()
    if jittered is not None:
        table.add("jitter", scene.name, _errors(excerpt(jittered, truth.impact, span), true))
    held = excerpt(frozen(truth.states, truth.impact), truth.impact, span)
    table.add("still", scene.name, _errors(held, true))
    for label, r_p in RATIOS.items():
        if r_p < 1:
            table.add(f"merged {label}", scene.name, _errors(metrics.merged_states(true, r_p), true))
    for name in _names():
        solver = _maker(name)(scene)
        solver.advance(truth.impact)
        run = record(solver, span, every=EVERY)
        states = dataclasses.replace(
            run, frames=run.frames[1:], positions=run.positions[1:], velocities=run.velocities[1:]
        )
        table.add(name, scene.name, _errors(states, true))
        facts.enter(name, solver, _density(states))


def _errors(predicted: Recording, true: Recording) -> dict[str, float]:
    measured = metrics.compare(predicted, true)
    rows = {frame: frame // EVERY - 1 for frame in AT if frame // EVERY <= len(true.frames)}
    found: dict[str, float] = {}
    for field, measure in _GRID.items():
        found[field] = float(measured[measure].mean())
        found |= {f"{field}_{frame}": float(measured[measure][row]) for frame, row in rows.items()}
    moved = [frame // EVERY - 1 for frame in _TRANSPORTED if frame // EVERY <= len(true.frames)] or [-1]
    transport = metrics.sliced_distance(
        predicted.positions[moved], predicted.mass, true.positions[moved], true.mass
    )
    means = {name: float(measured[name].mean()) for name in _MEANS}
    return {**found, **means, "transport": float(transport.mean())}


def _density(states: Recording) -> float:
    """Return the 99th percentile of the density in the last state, over that at rest [-]."""
    rest = {material.type_id: material.density for material in states.scene.materials}
    volumes = states.mass / np.array([rest[kind] for kind in states.types.tolist()])
    return float(metrics.density_percentile(states.positions[-1], volumes, states.scene.resolution))


def _row(name: str, table: metrics.ErrorTable, facts: _Facts, times: FrameTimes | None) -> Row:
    kind, _, label = name.partition(" ")
    entry = next(row for row in table.rows() if row["method"] == name)
    known = name in facts.particles
    few = name if _is_bound(name) else f"mpm {label}"
    return {
        "method": kind,
        "label": label or None,
        "r_p": round(RATIOS[label], 4) if label else None,
        "particles": float(np.mean(facts.particles[name])) if known else None,
        "resolution": float(np.mean(facts.resolution[name])) if known else None,
        "ms_per_frame": significant(times.unseen if times else None),
        "ms_shown": significant(times.shown if times else None),
        "density": significant(max(facts.density[name])) if known else None,
        "redone": facts.redone[name] if known else None,
        **{key: significant(value) for key, value in entry.items() if key != "method" and key[-2:] != "_n"},
        **_apart(table, name, few, "error", "minus_mpm"),
        **_apart(table, name, f"carried {label}" if kind == "fitted" else name, "error", "minus_carried"),
        **_apart(table, name, few, "transport", "transport_minus_mpm"),
    }


def _apart(table: metrics.ErrorTable, name: str, other: str, measure: str, field: str) -> Row:
    """Return the mean difference of two methods and its standard error; None where one of them is missing."""
    has_both = name != other and other in table.methods
    apart = table.difference(name, other, measure) if has_both else None
    return {
        field: significant(apart.mean if apart else None),
        f"{field}_se": significant(apart.standard_error if apart else None),
    }

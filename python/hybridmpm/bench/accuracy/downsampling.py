"""What fewer particles cost and save when only MPM runs, beside the floors and the ceiling of the error."""

import dataclasses
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hybridmpm import metrics, scenarios
from hybridmpm._support import charts
from hybridmpm.bench.accuracy.conventions import AT, EVERY, FIRST_SEED, RATIOS
from hybridmpm.bench.report.rows import Progress, Row, significant
from hybridmpm.bench.report.timing import TimedSimulation, time_per_frame
from hybridmpm.downsampling import strided, upsample
from hybridmpm.mpm import MpmSolver
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene

_TIMED_FRAMES = 20
_ALONE = ("grid_rmse", "grid_nrmse", "grid_node_error")
"""Errors that are also reported at single frames."""


@dataclass(frozen=True, kw_only=True)
class DownsamplingSettings:
    """Scenes, length and repetitions of the measurement."""

    scenarios: tuple[str, ...] = ("water_2d", "sand_2d", "water_3d", "sand_3d")
    """Scenarios that the scenes are drawn from."""
    scenes: int = 5
    """Number of scenes of each scenario in 2D."""
    scenes_3d: int = 3
    """Number of scenes of each scenario in 3D, which take longer."""
    frames: int = 200
    """Number of frames of each scene."""
    repeats: int = 5
    """Number of timings of each method; the lower quartile counts."""
    carry: bool = False
    """Whether solvers that carry all particles of the scene are measured, too."""

    def seeds(self, scenario: str) -> range:
        """Return the seeds of a scenario's scenes."""
        count = self.scenes if scenarios.describe(scenario).dim == 2 else self.scenes_3d
        return range(FIRST_SEED, FIRST_SEED + count)

    @property
    def count(self) -> int:
        """Number of scenes in all."""
        return sum(len(self.seeds(scenario)) for scenario in self.scenarios)


def measure(settings: DownsamplingSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure each scenario and yield a row for each method and r_p; `on_progress` counts scenes.

    The truth is MPM with all particles and the ground truth's substeps. The methods are `mpm`, merged
    particles on a coarse grid at CFL substeps; `upsampled`, all particles carried along by its recording, and
    `carried`, by the solver itself (`MpmSolver(carry=True)`, shown every tenth frame); `merged`, the truth
    merged state by state, which no method with so many particles can beat but by chance; `jitter`, the truth
    with other jitter; `still`, the initial state held. Errors are means over the scenes, the fields ending in
    `_se` their standard errors, `_difference` the mean difference to MPM with all particles on the same
    scenes. `MEASURE_mean` is the mean over the rollout, `MEASURE_40` that of frame 40.

    Raises
    ------
    ConfigError
        POT is not installed.
    """
    for scenario in settings.scenarios:
        table = metrics.ErrorTable()
        facts: dict[str, list[dict[str, float]]] = {}
        for seed in settings.seeds(scenario):
            scene = scenarios.get(scenario, seed)
            for method, errors, fact in _measured_scene(scene, settings):
                table.add(method, scene.name, errors)
                facts.setdefault(method, []).append(fact)
            on_progress(1)
        for row in table.rows(reference="mpm 1"):
            method, _, label = row.pop("method").partition(" ")
            yield {
                "scenario": scenario,
                "method": method,
                "label": label or None,
                "r_p": round(RATIOS[label], 4) if label else None,
                "scenes": len(settings.seeds(scenario)),
                **_mean_facts(facts[f"{method} {label}".strip()]),
                **{name: significant(value) for name, value in row.items() if not name.endswith("_n")},
            }


def _measured_scene(
    scene: Scene, settings: DownsamplingSettings
) -> Iterator[tuple[str, dict[str, float], dict[str, float]]]:
    """Yield each method's name, its errors, and its particles, resolution and cost in a scene."""
    truth = MpmSolver(scene, substeps="reference")
    true = record(truth, settings.frames, every=EVERY)
    other = record(MpmSolver(metrics.other_jitter(scene), substeps="reference"), settings.frames, every=EVERY)
    solvers = {label: MpmSolver(scene, r_p=r_p) for label, r_p in RATIOS.items()}
    # Keyed by method and, after a space, label of r_p.
    states: dict[str, Recording] = {"jitter": other, "still": metrics.held_still(true)}
    carrying = {}
    for label, solver in solvers.items():
        run = record(solver, settings.frames)
        states[f"mpm {label}"] = strided(run, EVERY)
        states[f"merged {label}"] = metrics.merged_states(true, RATIOS[label])
        began = time.perf_counter()
        states[f"upsampled {label}"] = _upsampled(run, true, solver.resolution)
        carrying[label] = (time.perf_counter() - began) / settings.frames
    carriers = {
        f"carried {label}": MpmSolver(scene, r_p=r_p, carry=True)
        for label, r_p in RATIOS.items()
        if settings.carry and r_p < 1
    }
    for method, solver in carriers.items():
        states[method] = record(solver, settings.frames, every=EVERY)
    runs = {"": truth, **solvers, **carriers}
    times = time_per_frame([_timed(solver, settings) for solver in runs.values()], settings.repeats)
    seconds = {label: spent.seconds for label, spent in zip(runs, times, strict=True)}
    for method, recording in states.items():
        kind, _, label = method.partition(" ")
        fact = {"particles": float(len(recording.mass)), "resolution": float(scene.resolution)}
        if kind in {"mpm", "upsampled", "jitter"}:
            fact["ms_per_frame"] = 1e3 * (seconds[label] + (carrying[label] if kind == "upsampled" else 0.0))
        if kind == "carried":
            fact["ms_per_frame"] = 1e3 * seconds[method]
        if kind in {"mpm", "upsampled", "carried"}:
            fact["resolution"] = float(solvers[label].resolution)
        yield method, _errors(recording, true), fact


def _upsampled(run: Recording, true: Recording, resolution: int) -> Recording:
    path = upsample(run, true.positions[0], resolution=resolution)
    velocities = np.diff(path, axis=0) / np.float32(run.scene.frame_dt)
    return dataclasses.replace(
        true,
        positions=path[::EVERY],
        velocities=np.concatenate([true.velocities[:1], velocities[EVERY - 1 :: EVERY]]),
    )


def _timed(solver: MpmSolver, settings: DownsamplingSettings) -> TimedSimulation:
    """Return a simulation of the middle of the run, where the splash is."""
    solver.reset()
    solver.advance(settings.frames // 2)
    start = solver.snapshot()
    return TimedSimulation(
        restore=partial(solver.restore, start),
        advance=solver.advance,
        frames=min(_TIMED_FRAMES, settings.frames),
    )


def _errors(predicted: Recording, true: Recording) -> dict[str, float]:
    errors = metrics.compare(predicted, true)
    rows = {frame: row for row, frame in enumerate(true.frames.tolist()) if frame in AT}
    alone = {f"{name}_{frame}": errors[name][row] for name in _ALONE for frame, row in rows.items()}
    for frame, row in rows.items():
        alone[f"sinkhorn_{frame}"] = float(
            metrics.sinkhorn_distance(
                predicted.positions[row], predicted.mass, true.positions[row], true.mass
            )
        )
    # The first state is given, not predicted.
    return alone | {f"{name}_mean": float(values[1:].mean()) for name, values in errors.items()}


def _mean_facts(facts: Sequence[dict[str, float]]) -> dict[str, float | None]:
    return {
        name: round(float(np.mean([fact[name] for fact in facts])), digits) if name in facts[0] else None
        for name, digits in (("particles", 1), ("resolution", 1), ("ms_per_frame", 4))
    }


def chart(rows: Sequence[Row], file: Path) -> None:
    """Draw error and cost against r_p, as SVG and PNG; raises as `charts.panels` and `charts.save`."""
    names = list(dict.fromkeys(row["scenario"] for row in rows))
    figure, axes = charts.panels(columns=len(names), rows=2, width=3.6, height=3.2)
    for column, name in enumerate(names):
        mine = [row for row in rows if row["scenario"] == name]
        error, cost = axes[:, column]
        for index, (method, label) in enumerate(
            (
                ("mpm", "MPM"),
                ("upsampled", "MPM, carried from its recording"),
                ("merged", "truth, merged"),
                ("carried", "MPM, carrying all particles"),
            )
        ):
            points = [row for row in mine if row["method"] == method]
            if not points:
                continue
            style = {"marker": charts.MARKERS[index], "color": charts.COLOURS[index]}
            at = [row["r_p"] for row in points]
            means = [row["grid_rmse_mean"] for row in points]
            spread = [row["grid_rmse_mean_se"] or 0.0 for row in points]
            error.errorbar(at, means, spread, label=label, capsize=2, **style)
            if method != "merged":
                cost.plot(at, [row["ms_per_frame"] for row in points], **style)
        bounds = {row["method"]: row for row in mine if row["r_p"] is None}
        for method, label, dashes in (("still", "held still", ":"), ("jitter", "truth, other jitter", "--")):
            colour = charts.COLOURS[5]
            error.axhline(bounds[method]["grid_rmse_mean"], label=label, linestyle=dashes, color=colour)
        cost.axhline(bounds["jitter"]["ms_per_frame"], linestyle="--", color=charts.COLOURS[5])
        error.set(title=name, ylim=(0, None), ylabel="grid_rmse, mean of rollout" if column == 0 else "")
        cost.set(yscale="log", xlabel="$r_p$", ylabel="ms per frame" if column == 0 else "")
        for panel in (error, cost):
            panel.set(xscale="log", xticks=list(RATIOS.values()), xticklabels=list(RATIOS))
            panel.minorticks_off()
    entries = {1: 1, 2: 3}.get(len(names), 5)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=entries)
    charts.save(figure, file)

"""The guards' cost, their correlation with the error, their delay after impacts, and their false alarms.

The field `part` tells kinds of rows apart: `cost`, `point` and `correlation`, `delay`, and `false alarms`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, scenarios
from hybridmpm.bench.accuracy.conventions import FIRST_SEED
from hybridmpm.bench.accuracy.grid import present_grid_mass
from hybridmpm.bench.accuracy.impact import first_impact
from hybridmpm.bench.hybrid.guard_values import AUDIT_PERIOD, GuardValues
from hybridmpm.bench.hybrid.rank_correlations import rank_correlations
from hybridmpm.bench.report.rows import Progress, Row
from hybridmpm.bench.report.timing import Clock
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid.audits import Audit, Drift
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import as_stepper, model_for
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Ball, Box, Scene

GUARD = "guard: "
"""Beginning of the names of fields that hold values of guards."""

_HELD = 500
"""Frames in which a drop is held over a pool while the pool comes to rest."""
_RESTING = 400
"""Frame from which on the pool is at rest."""
_HIGH = 0.2
"""Height between the drop and the pool [m]."""
_SPLASH = 80
"""Frame from which on MPM is timed."""
_AUDITS = (Audit.name, Drift.name)
"""Guards that compare a step with MPM's own; the first of them pays for it."""
_SEEN = 120
"""Number of frames after the drop is let go."""
_NOTICED = 40
"""Frames after an impact in which an alarm counts as caused by the impact."""
DROPS = {"drop of 0.6 %": 0.01, "drop of 2 %": 0.02, "drop of 8 %": 0.04}
"""Radius of the drop [m] by label, which tells its share of all particles."""


@dataclass(frozen=True, kw_only=True)
class SafeguardSettings:
    """Extent of the measurement."""

    model: str | None = None
    """Name of the network, or "zero" for free fall; None takes the first that serves each scenario."""
    scenarios: tuple[str, ...] = scenarios.NAMES
    """Scenarios in which values and errors are compared."""
    scenes: int = 10
    """Number of scenes of each scenario."""
    frames: int = 200
    """Number of frames of each scene."""

    @property
    def count(self) -> int:
        """Number of scenes in all, those of the impacts included."""
        return len(self.scenarios) * self.scenes + self.scenes + len(DROPS)


def measure(settings: SafeguardSettings, on_progress: Progress) -> Iterator[Row]:
    """Measure and yield the rows; `on_progress` counts scenes.

    `cost` is the median time of a guard a frame [us], and its share of a frame of MPM with the same
    particles; what several guards share has a row of its own (`history`, of cosine and impact; `state`, of
    density, energy and divergence). `point` holds the values of the guards at a frame of the network left
    alone, and the network's error (grid RMSE against the truth). `correlation` is Spearman's, over the points
    of a scenario, and apart from time; the guard `frame` is the frame number alone. `delay` counts the frames
    from an impact to the first alarm, None without an alarm in time. The motion is MPM's own there, so that
    no error of a network gives the impact away. `false alarms` counts the steps with an alarm on a pool of
    water at rest.
    """
    for scenario in settings.scenarios:
        points: list[Row] = []
        for seed in range(FIRST_SEED, FIRST_SEED + settings.scenes):
            scene = scenarios.get(scenario, seed)
            network = as_stepper(model_for(settings.model, scenario), scene)
            values = GuardValues(scene, network.r_p, network.r_t)
            points += _points(scene, network, values, settings.frames)
            if seed == FIRST_SEED:
                for row in _costs(scene, network, values):
                    yield {"part": "cost", "scenario": scenario} | row
            on_progress(1)
        for point in points:
            yield {"part": "point", "scenario": scenario} | point
        for row in _correlations(points):
            yield {"part": "correlation", "scenario": scenario} | row
    yield from _impacts(settings, on_progress)


def _points(scene: Scene, network: Stepper, guards: GuardValues, frames: int) -> list[Row]:
    """Let the network simulate alone, and return its errors and the guards' values every 10 frames."""
    truth = MpmSolver(scene, substeps="reference")
    simulator = NeuralPhysics(scene, network, carry=False)
    points = []
    latest: dict[str, float] = {}
    for _ in range(frames // network.r_t):
        try:
            simulator.advance(network.r_t)
            values = guards.after_step(simulator.positions)
        except SimulationError:
            break
        # Some guards look at some steps only.
        latest |= {name: value for name, value in values.items() if value is not None}
        if simulator.frame % 10 < network.r_t:
            truth.advance(simulator.frame - truth.frame)
            error = metrics.grid_rmse(present_grid_mass(simulator), present_grid_mass(truth))
            named = {f"{GUARD}{name}": round(value, 5) for name, value in latest.items()}
            points.append({"scene": scene.name, "frame": simulator.frame, "error": round(error, 5)} | named)
    return points


def _costs(scene: Scene, network: Stepper, values: GuardValues) -> Iterator[Row]:
    mpm = MpmSolver(scene, r_p=network.r_p)
    mpm.advance(_SPLASH)
    frames: list[float] = []
    for _ in range(_SPLASH // 2):
        with Clock(frames):
            mpm.advance(1)
    for name, times in values.seconds.items():
        # Few steps are audited, but those are long; a simulator audits fewer than are here.
        audited = np.mean(times) * AUDIT_PERIOD / Audit.period
        typical = audited if name in _AUDITS else np.median(times)
        per_frame = float(typical) / network.r_t
        yield {
            "guard": name,
            "particles": mpm.particle_count,
            "us_per_frame": round(1e6 * per_frame, 2),
            "share_of_mpm": round(per_frame / float(np.median(frames)), 4),
        }


def _correlations(points: Sequence[Row]) -> Iterator[Row]:
    for name in ("frame", *sorted({key for point in points for key in point if key.startswith(GUARD)})):
        known = [(point["frame"], point[name], point["error"]) for point in points if name in point]
        whole, partial = rank_correlations(*np.array(known, dtype=np.float64).T)
        yield {
            "guard": name.removeprefix(GUARD),
            "spearman": whole,
            "spearman_without_time": None if name == "frame" else partial,
            "points": len(known),
        }


def _impacts(settings: SafeguardSettings, on_progress: Progress) -> Iterator[Row]:
    for seed in range(FIRST_SEED, FIRST_SEED + settings.scenes):
        scene = scenarios.get("water_2d", seed)
        impact = first_impact(MpmSolver(scene), _HELD)
        path = MpmSolver(scene).rollout(impact + _NOTICED + 1)
        yield from _delays("bodies on the floor", scene, path, impact)
        on_progress(1)
    for label, radius in DROPS.items():
        scene = _pool_and_drop(radius)
        path, impact = _drop_falls(scene)
        yield from _delays(label, scene, path, impact)
        if label == next(iter(DROPS)):
            yield from _false_alarms(scene, path)
        on_progress(1)


def _pool_and_drop(radius: float) -> Scene:
    pool = Box(material="water", lower=(0.1, 0.1), upper=(0.9, 0.16))
    drop = Ball(material="water", center=(0.5, 0.3), radius=radius, seed=2)
    return Scene(name="a drop on a pool", dim=2, resolution=64, bodies=(pool, drop))


def _drop_falls(scene: Scene) -> tuple[npt.NDArray[np.float32], int]:
    """Hold the drop until the pool is at rest, and let the drop go.

    Returns
    -------
    float32 (F, N, D)
        Positions of each frame [m].
    int
        Frame of the impact.
    """
    solver = MpmSolver(scene)
    drop = solver.positions[:, 1] > _HIGH
    held = np.zeros((solver.particle_count, scene.dim), dtype=np.float32)
    held[drop] = -np.array(scene.gravity)
    resting = solver.rollout(_HELD, held)
    path = np.concatenate([resting, solver.rollout(_SEEN)[1:]])
    fall = np.diff(path[_HELD:, drop, 1].mean(axis=1, dtype=np.float64), n=2) / scene.frame_dt**2
    return path, _HELD + 2 + int(np.argmax(fall[1:] > 0.8 * scene.gravity[1]))


def _delays(label: str, scene: Scene, path: npt.NDArray[np.float32], impact: int) -> Iterator[Row]:
    alarms = _alarms(scene, path)
    for name, frames in alarms.items():
        after = [frame - impact for frame in frames if 0 <= frame - impact <= _NOTICED]
        yield {
            "part": "delay",
            "event": label,
            "scene": scene.name,
            "guard": name,
            "impact": impact,
            "delay": after[0] if after else None,
            "alarms_before": sum(impact - _NOTICED <= frame < impact for frame in frames),
        }


def _false_alarms(scene: Scene, path: npt.NDArray[np.float32]) -> Iterator[Row]:
    for name, frames in _alarms(scene, path[: _HELD + 1]).items():
        yield {
            "part": "false alarms",
            "scene": "a pool at rest",
            "guard": name,
            "frames": _HELD - _RESTING,
            "alarms": sum(frame > _RESTING for frame in frames),
        }


def _alarms(scene: Scene, path: npt.NDArray[np.float32]) -> dict[str, list[int]]:
    """Return the frames with an alarm by guard, MPM's own motion being taken for a network's with r_t = 1.

    Audits are left out: they would compare MPM with itself.
    """
    values = GuardValues(scene, 1.0, 1)
    for name in _AUDITS:
        del values.guards[name]
    alarms: dict[str, list[int]] = {name: [] for name in values.guards}
    for frame in range(1, len(path)):
        for name, value in values.after_step(path[frame]).items():
            if value is not None and values.guards[name].alarms(value):
                alarms[name].append(frame)
    return alarms

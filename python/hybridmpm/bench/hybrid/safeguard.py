"""What the guards cost, how well they tell the error, how fast they notice impacts, and false alarms.

Four kinds of rows, told apart by `part`: `cost`, `point` and `correlation`, `delay`, and `false alarms`.
"""

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, scenarios
from hybridmpm.bench.accuracy.impact import first_impact
from hybridmpm.bench.accuracy.rollouts import FIRST_SEED
from hybridmpm.bench.hybrid.guard_values import AUDIT_PERIOD, Clock, Watch
from hybridmpm.bench.report.provenance import Provenance
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid.guards import Audit
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.load import as_stepper, model_for
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Ball, Box, Scene

GUARD = "guard: "
"""Begins the names of fields that hold values of guards."""

_HELD = 500
"""Frames in which a drop is held over a pool while this comes to rest."""
_RESTING = 400
"""From this frame on the pool is at rest."""
_HIGH = 0.2
"""The drop is above this height, the pool below [m]."""
_SPLASH = 80
"""Frame from which the time of MPM is taken."""
_SEEN = 120
"""Frames after the drop is let go."""
_NOTICED = 40
"""An alarm more frames than this after an impact is not because of it."""
DROPS = {"drop of 0.6 %": 0.01, "drop of 2 %": 0.02, "drop of 8 %": 0.04}
"""Radius [m] by label; the share is that of all particles."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Extent of the measurement."""

    model: str | None = None
    """Name of the network, "zero" for free fall; the first that serves each scenario if absent."""
    scenarios: tuple[str, ...] = scenarios.NAMES
    scenes: int = 3
    """Of each scenario."""
    frames: int = 200
    """Of each scene."""

    @property
    def count(self) -> int:
        """Scenes in all, those of the impacts included."""
        return len(self.scenarios) * self.scenes + self.scenes + len(DROPS)


def rows(
    settings: Settings, source: Provenance, on_progress: Callable[[int], object]
) -> Iterator[dict[str, Any]]:
    """Measure and yield the rows; `on_progress` counts scenes.

    `cost`: median time of a guard a frame [us], of what several share once (`history`: of cosine and impact;
    `state`: of density, energy and divergence), and as a share of a frame of MPM with the same particles.
    `point`: values of the guards at a frame of the network left alone, and its error (grid RMSE against the
    truth). `correlation`: Spearman's, over the points of a scenario. `delay`: frames from an impact to the
    first alarm, None if there is none within `_NOTICED`; the motion is MPM's own, so that no error of a
    network gives it away. `false alarms`: steps with an alarm on a pool of water at rest.
    """
    origin = dataclasses.asdict(source)
    for scenario in settings.scenarios:
        points: list[dict[str, Any]] = []
        for seed in range(FIRST_SEED, FIRST_SEED + settings.scenes):
            scene = scenarios.get(scenario, seed)
            network = as_stepper(model_for(settings.model, scenario), scene)
            watch = Watch(scene, network.r_p, network.r_t)
            points += _points(scene, network, watch, settings.frames)
            if seed == FIRST_SEED:
                for row in _costs(scene, network, watch):
                    yield {"part": "cost", "scenario": scenario} | row | origin
            on_progress(1)
        for point in points:
            yield {"part": "point", "scenario": scenario} | point | origin
        for row in _correlations(points):
            yield {"part": "correlation", "scenario": scenario} | row | origin
    for row in _impacts(settings, on_progress):
        yield row | origin


def _points(scene: Scene, network: Stepper, watch: Watch, frames: int) -> list[dict[str, Any]]:
    """Let the network go on alone, and return errors and values every 10 frames."""
    truth = MpmSolver(scene, substeps="reference")
    simulator = NeuralPhysics(scene, network)
    points = []
    latest: dict[str, float] = {}
    for _ in range(frames // network.r_t):
        try:
            simulator.advance(network.r_t)
            values = watch.see(simulator.positions)
        except SimulationError:
            break
        # Some guards look at some steps only.
        latest |= {name: value for name, value in values.items() if value is not None}
        if simulator.frame % 10 < network.r_t:
            truth.advance(simulator.frame - truth.frame)
            error = metrics.grid_rmse(_mass(simulator, scene), _mass(truth, scene))
            named = {f"{GUARD}{name}": round(value, 5) for name, value in latest.items()}
            points.append({"scene": scene.name, "frame": simulator.frame, "error": round(error, 5)} | named)
    return points


def _mass(simulator: Any, scene: Scene) -> npt.NDArray[np.float32]:
    return metrics.grid_mass(np.clip(simulator.positions, 0, 1), simulator.mass, scene.resolution)


def _costs(scene: Scene, network: Stepper, watch: Watch) -> Iterator[dict[str, Any]]:
    mpm = MpmSolver(scene, r_p=network.r_p)
    mpm.advance(_SPLASH)
    frames: list[float] = []
    for _ in range(_SPLASH // 2):
        with Clock(frames):
            mpm.advance(1)
    for name, times in watch.seconds.items():
        # Few steps are audited, but those are long; a simulator audits fewer than are here.
        audited = np.mean(times) * AUDIT_PERIOD / Audit.PERIOD
        typical = audited if name == Audit.name else np.median(times)
        per_frame = float(typical) / network.r_t
        yield {
            "guard": name,
            "particles": mpm.particle_count,
            "us_per_frame": round(1e6 * per_frame, 2),
            "share_of_mpm": round(per_frame / float(np.median(frames)), 4),
        }


def _correlations(points: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    from scipy.stats import spearmanr  # noqa: PLC0415 - an extra

    for key in sorted({key for point in points for key in point if key.startswith(GUARD)}):
        pairs = np.array([(point[key], point["error"]) for point in points if key in point])
        constant = len(pairs) < 3 or np.ptp(pairs, axis=0).min() == 0
        rank = None if constant else round(float(spearmanr(pairs[:, 0], pairs[:, 1]).statistic), 4)
        yield {"guard": key.removeprefix(GUARD), "spearman": rank, "points": len(pairs)}


def _impacts(settings: Settings, on_progress: Callable[[int], object]) -> Iterator[dict[str, Any]]:
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
    """Hold the drop until the pool is at rest, and let it go.

    Returns
    -------
    float32 (F, N, D), int
        Positions [m] of each frame, and the frame of the impact.
    """
    solver = MpmSolver(scene)
    drop = solver.positions[:, 1] > _HIGH
    held = np.zeros((solver.particle_count, scene.dim), dtype=np.float32)
    held[drop] = -np.array(scene.gravity)
    resting = solver.rollout(_HELD, held)
    path = np.concatenate([resting, solver.rollout(_SEEN)[1:]])
    fall = np.diff(path[_HELD:, drop, 1].mean(axis=1, dtype=np.float64), n=2) / scene.frame_dt**2
    return path, _HELD + 2 + int(np.argmax(fall[1:] > 0.8 * scene.gravity[1]))


def _delays(label: str, scene: Scene, path: npt.NDArray[np.float32], impact: int) -> Iterator[dict[str, Any]]:
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


def _false_alarms(scene: Scene, path: npt.NDArray[np.float32]) -> Iterator[dict[str, Any]]:
    for name, frames in _alarms(scene, path[: _HELD + 1]).items():
        yield {
            "part": "false alarms",
            "scene": "a pool at rest",
            "guard": name,
            "frames": _HELD - _RESTING,
            "alarms": sum(frame > _RESTING for frame in frames),
        }


def _alarms(scene: Scene, path: npt.NDArray[np.float32]) -> dict[str, list[int]]:
    """Frames with an alarm, by guard, when MPM's own motion is taken for a network's with r_t = 1.

    Without the audit, which would hold MPM against itself.
    """
    watch = Watch(scene, 1.0, 1)
    del watch.guards[Audit.name]
    alarms: dict[str, list[int]] = {name: [] for name in watch.guards}
    for frame in range(1, len(path)):
        for name, value in watch.see(path[frame]).items():
            if value is not None and watch.guards[name].alarms(value):
                alarms[name].append(frame)
    return alarms

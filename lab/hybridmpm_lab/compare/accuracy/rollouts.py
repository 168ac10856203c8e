"""The truth of test scenes, and the errors of simulators against it from some frame on."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from hybridmpm import metrics
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.planner.calibrating.impact import LONGEST_FALL, first_impact
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator
from hybridmpm_lab.compare.accuracy.conventions import AT, EVERY

_GRID = ("error", "grid_nrmse")
_MEANS = ("kinetic_energy", "mechanical_energy", "centroid", "max_density", "neighbours", "penetrations")
MEASURES = (
    *(name for measure in _GRID for name in (measure, *(f"{measure}_{frame}" for frame in AT))),
    *(f"sinkhorn_{frame}" for frame in AT),
    *_MEANS,
)
"""Names of the errors that `errors` returns, and of the Sinkhorn distances that it returns on demand."""


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The truth of a scene: MPM at full resolution with the ground truth's substeps."""

    impact: int
    """Frame of the first impact."""
    states: Recording
    """State at each frame from the start on."""

    @classmethod
    def of(cls, scene: Scene, *, latest_warm_up: int, span: int) -> "Truth":
        """Simulate until `span` frames after the first impact, or after `latest_warm_up` if that is later."""
        solver = MpmSolver(scene, substeps="reference")
        impact = first_impact(solver, LONGEST_FALL)
        solver.reset()
        return cls(impact=impact, states=record(solver, max(impact, latest_warm_up) + span))

    @property
    def frames(self) -> int:
        """Number of frames after the start."""
        return len(self.states.frames) - 1

    def start(self, warm_up: int) -> int:
        """Return the frame from which errors count: the first impact, or the end of a warm-up where later."""
        return max(self.impact, warm_up)

    def with_other_jitter(self) -> Recording | None:
        """Simulate the scene once more, its particles jittered otherwise: what the truth itself leaves open.

        None where that simulation fails.
        """
        scene = metrics.other_jitter(self.states.scene)
        return rollout(MpmSolver(scene, substeps="reference"), self.frames)


def rollout(simulator: Simulator, frames: int) -> Recording | None:
    """Record each frame of a simulator from its present one on; None where it fails on the way."""
    try:
        return record(simulator, frames)
    except SimulationError:
        return None


def excerpt(recording: Recording, start: int, span: int) -> Recording:
    """Return every tenth of the `span` states after `start`, of a recording of each frame."""
    rows = slice(start + EVERY, start + span + 1, EVERY)
    return dataclasses.replace(
        recording,
        frames=recording.frames[rows],
        positions=recording.positions[rows],
        velocities=recording.velocities[rows],
    )


def frozen(recording: Recording, start: int) -> Recording:
    """Return the recording with the state of `start`, at rest, in place of all others."""
    held = np.broadcast_to(recording.positions[start], recording.positions.shape)
    return dataclasses.replace(recording, positions=held, velocities=np.zeros_like(recording.velocities))


def errors(predicted: Recording, true: Recording, *, transport: bool) -> dict[str, float]:
    """Compare two excerpts.

    Parameters
    ----------
    predicted, true : Recording
    transport : bool
        Whether to compute Sinkhorn distances, which take long.

    Returns
    -------
    dict
        Errors by their names in `MEASURES`: `error` is the mean of `grid_rmse` over the states, `error_40`
        the `grid_rmse` of the state 40 frames after the start; `grid_nrmse` and `grid_nrmse_40` are the same
        for that measure; `sinkhorn_40` is the Sinkhorn distance of that state [m]; all others are means over
        the states of what `metrics.compare` measures.
    """
    measured = metrics.compare(predicted, true)
    measured["error"] = measured["grid_rmse"]
    rows = {frame: frame // EVERY - 1 for frame in AT if frame // EVERY <= len(true.frames)}
    found = {name: float(measured[name].mean()) for name in (*_GRID, *_MEANS)}
    found |= {f"{name}_{frame}": float(measured[name][row]) for name in _GRID for frame, row in rows.items()}
    if transport:
        found |= {f"sinkhorn_{frame}": _sinkhorn(predicted, true, row) for frame, row in rows.items()}
    return found


def _sinkhorn(predicted: Recording, true: Recording, row: int) -> float:
    distance = metrics.sinkhorn_distance(
        predicted.positions[row], predicted.mass, true.positions[row], true.mass
    )
    return float(distance)

"""Held-out scenes with their truth, and the errors of simulators on them from a frame on."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from hybridmpm import metrics
from hybridmpm.bench.accuracy.impact import LONGEST_FALL, first_impact
from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator

FIRST_SEED = 1_100_000
"""Of the scenes: no data set for training or validation draws from these on."""
AT = (40, 100, 200)
"""Frames, counted from the start of a span, whose errors are reported alone."""
EVERY = 10
"""Frames between two states compared."""

_GRID = ("error", "grid_nrmse")
_MEANS = ("kinetic_energy", "mechanical_energy", "centroid", "max_density", "neighbours", "penetrations")
MEASURES = (
    *(name for measure in _GRID for name in (measure, *(f"{measure}_{frame}" for frame in AT))),
    *(f"sinkhorn_{frame}" for frame in AT),
    *_MEANS,
)
"""What `errors` may hold."""


@dataclass(frozen=True, kw_only=True)
class Truth:
    """A scene at full resolution with the ground truth's substeps."""

    impact: int
    """Frame of the first impact."""
    states: Recording
    """Of each frame from the start on."""

    @classmethod
    def of(cls, scene: Scene, *, latest_warm_up: int, span: int) -> "Truth":
        """Simulate until `span` frames after the first impact, or after `latest_warm_up` if that is later."""
        solver = MpmSolver(scene, substeps="reference")
        impact = first_impact(solver, LONGEST_FALL)
        solver.reset()
        return cls(impact=impact, states=record(solver, max(impact, latest_warm_up) + span))

    @property
    def frames(self) -> int:
        """How many there are."""
        return len(self.states.frames) - 1

    def start(self, warm_up: int) -> int:
        """Frame from which errors count: the first impact, or the first prediction if that is later."""
        return max(self.impact, warm_up)


def rollout(simulator: Simulator, frames: int) -> Recording | None:
    """Record each frame of a simulator from where it is; None where it fails on the way."""
    try:
        return record(simulator, frames)
    except SimulationError:
        return None


def excerpt(recording: Recording, start: int, span: int) -> Recording:
    """Take every tenth state of the `span` frames after `start`, of a recording of each frame."""
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

    Returns
    -------
    dict
        Of `MEASURES`: `error`, the mean of `grid_rmse` over the states, and `error_40`, that of the state so
        many frames after the start; the same for `grid_nrmse`; where `transport`, `sinkhorn_40` [m]; means of
        what else `metrics.compare` has.
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

"""Steps that need neither a network nor MPM: everything falls freely, or everything is at rest."""

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.decisions import StepSource
from hybridmpm.physics.track import Track
from hybridmpm.scene.particle_types import KINEMATIC

REACH = 2.0
"""Distance up to which particles and walls are near [spacings of the particles]."""
TOLERANCE = 0.05 * 9.81
"""Acceleration [m/s^2] that free fall may leave unexplained in a step."""
STILL = 0.05
"""Speed [m/s] below which a particle at rest has been over all steps of the track's history."""
SETTLED = 2.0
"""Mean acceleration [m/s^2] below which it has been: a thrown body is slow at its top."""
ROUSED = 0.15
"""Speed [m/s] of a particle that rouses those near it."""
_UNNOTICED = 1e-4

_Floats = npt.NDArray[np.float32]


class Shortcuts:
    """The next step of a track, where all particles fall freely or all are at rest.

    Parameters
    ----------
    spacing : float
        Distance of the particles at rest [m].
    """

    def __init__(self, spacing: float) -> None:
        self._reach = REACH * spacing

    def step(self, track: Track) -> tuple[_Floats, StepSource] | None:
        """Return positions (N, D) [m] one step later, and their source; None where neither applies."""
        if self.resting(track).all():
            return track.states[-1].copy(), "rest"
        if self._falls(track):
            x, before = track.states[-1], track.states[-2]
            return x + (x - before) + track.gravity * np.float32(track.step_dt**2), "free_fall"
        return None

    def resting(self, track: Track) -> npt.NDArray[np.bool_]:
        """Return which particles (N,) are at rest: still for long, and nothing near them is fast."""
        velocities = np.diff(np.array(track.states), axis=0) / np.float32(track.step_dt)
        speeds = np.linalg.norm(velocities, axis=2)
        change = np.linalg.norm(velocities[-1] - velocities[0], axis=1)
        time = (len(velocities) - 1) * track.step_dt
        still: npt.NDArray[np.bool_] = (speeds.max(axis=0) < STILL) & (change < SETTLED * time)
        fast = speeds[-1] > ROUSED
        if still.any() and fast.any():
            graph = _core.radius_graph(track.states[-1], self._reach)
            still[graph.receivers[fast[graph.senders]]] = False
        return still

    def _falls(self, track: Track) -> bool:
        """Whether gravity alone moves all particles, and nothing is near that could change it."""
        history, types = track.history(), track.types
        graph = _core.radius_graph(history[-1], self._reach, types, kinematic=KINEMATIC)
        step = TOLERANCE * track.step_dt**2 / np.sqrt(_UNNOTICED)
        disturbed = _core.answer_weights(
            history,
            np.tile(track.gravity * np.float32(track.step_dt**2), (len(types), 1)),
            graph.starts,
            graph.senders,
            radius=self._reach,
            scale=[step] * history.shape[2],
            hops=0,
            quiet=_UNNOTICED,
            unnoticed=_UNNOTICED,
            most=1.0,
            lower=track.walls[0],
            upper=track.walls[1],
        )
        return not disturbed[types != KINEMATIC].any()

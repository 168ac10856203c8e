"""The network's side: what it is asked, and in which form."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.downsampling.merge import checked_ratio
from hybridmpm.errors import ConfigError
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import StepPath
from hybridmpm.scene import Scene
from hybridmpm.scene.kinematic import kinematic_particles
from hybridmpm.scene.particle_types import KINEMATIC

_Floats = npt.NDArray[np.float32]


class Network:
    """A network on one scene.

    Parameters
    ----------
    physics : Stepper
    scene : Scene
    types : uint8 (N,)
        Of the particles that move.
    """

    def __init__(self, physics: Stepper, scene: Scene, types: npt.NDArray[np.uint8]) -> None:
        self.physics = physics
        self.r_t = whole("r_t of the network", physics.r_t, 1, 100)
        self.dt = self.r_t * scene.frame_dt
        """Length of a step [s]."""
        self.walls = np.array([scene.walls.lower, scene.walls.upper], dtype=np.float32)
        spacing = scene.spacing * checked_ratio(physics.r_p) ** (-1 / scene.dim)
        self._solids = kinematic_particles(scene, spacing)
        self._count = len(types)
        self._types = np.concatenate([types.astype(np.int64), np.full(len(self._solids), KINEMATIC)])
        self._known = np.tile(np.array(scene.gravity, dtype=np.float32), (len(self._types), 1))
        self._bend = self._known[: self._count] * np.float32(self.dt**2)

    def step(self, path: Sequence[_Floats]) -> _Floats:
        """Return where the network says that particles are one step after the last of 6 states (N, D)."""
        states = np.stack(path)
        solids = np.broadcast_to(self._solids, (len(states), *self._solids.shape))
        history = np.ascontiguousarray(np.concatenate([states, solids], axis=1))
        x = np.asarray(self.physics.step(history, self._types, self._known, self.walls), dtype=np.float32)
        if x.shape != history.shape[1:]:
            raise ConfigError(f"the network must answer positions {history.shape[1:]}, got {x.shape}")
        return x[: self._count]

    def between(self, before: _Floats, now: _Floats, after: _Floats) -> StepPath:
        """Join two successive states (N, D) [m], given the one before."""
        return StepPath.between(before, now, after, self._bend)

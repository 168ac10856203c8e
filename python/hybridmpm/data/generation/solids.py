"""Obstacles in trajectories: particles of type 3 (kinematic) that come after those of the fluid."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.merging import spacing_at
from hybridmpm.data.control import Control
from hybridmpm.data.trajectory import Place, Trajectory
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene
from hybridmpm.scene.kinematic import kinematic_particles
from hybridmpm.scene.particle_types import KINEMATIC

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Solids:
    """The obstacles of a scene as K particles, to be added to the N particles of the solver."""

    points: Floats
    """Their positions (K, D) [m]."""

    @classmethod
    def of(cls, scene: Scene, r_p: float) -> "Solids":
        """Fill the obstacles of a scene; raises `ConfigError` where one of them moves."""
        return cls(kinematic_particles(scene, spacing_at(scene, r_p)))

    def placed(self, x: Floats) -> Floats:
        """Add their positions to positions (..., N, D) [m]; (..., N + K, D)."""
        fixed = np.broadcast_to(self.points, (*x.shape[:-2], *self.points.shape))
        return np.concatenate([x, fixed], axis=-2)

    def still(self, rates: Floats) -> Floats:
        """Add zeros to velocities or forces (..., N, D); (..., N + K, D)."""
        return np.concatenate([rates, np.zeros((*rates.shape[:-2], *self.points.shape), np.float32)], axis=-2)

    def trajectory(
        self,
        solver: MpmSolver,
        x: Floats,
        *,
        force: Floats | None,
        seed: int,
        control: Control | None = None,
    ) -> Trajectory:
        """Return the trajectory of a solver's particles at x (F, N, D) [m], with the obstacles.

        `force` (F - 1, N, D) [m/s^2] is that on the solver's particles; `control` has the obstacles already.
        """
        count = len(self.points)
        return Trajectory(
            positions=self.placed(x),
            types=np.concatenate([solver.materials.astype(np.int64), np.full(count, KINEMATIC, np.int64)]),
            force=None if force is None else self.still(force),
            mass=np.concatenate([solver.mass, np.zeros(count, np.float32)]),
            seed=seed,
            scene=solver.scene,
            control=control,
            place=Place(f"seed {seed}"),
        )

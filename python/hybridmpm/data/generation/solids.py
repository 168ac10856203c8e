"""Solids in trajectories, after the fluid's particles: rigid bodies of type 0, obstacles of type 3."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.merging import spacing_at
from hybridmpm.data.control import Control
from hybridmpm.data.trajectory import Place, Trajectory
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene
from hybridmpm.scene.kinematic import kinematic_particles
from hybridmpm.scene.particle_types import KINEMATIC, RIGID
from hybridmpm.scene.rigid import placed

Floats = npt.NDArray[np.float32]
_NO_BODIES = np.empty((1, 0, 13))


@dataclass(frozen=True, eq=False)
class Solids:
    """The obstacles of a scene as K particles, to be added to the N particles of the solver."""

    points: Floats
    """Their positions (K, D) [m]."""
    bodies: tuple[npt.NDArray[np.float64], ...] = ()
    """Points (k, D) of each rigid body in its own frame [m]."""

    @classmethod
    def of(cls, scene: Scene, r_p: float) -> "Solids":
        """Fill the solids of a scene; raises `ConfigError` where an obstacle moves."""
        spacing = spacing_at(scene, r_p)
        return cls(kinematic_particles(scene, spacing), tuple(body.filling(spacing) for body in scene.rigid))

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
        rigid: npt.NDArray[np.float64] = _NO_BODIES,
    ) -> Trajectory:
        """Return the trajectory of a solver's particles at x (F, N, D) [m], with the obstacles.

        `force` (F - 1, N, D) [m/s^2] is that on the solver's particles; `control` has the obstacles already;
        `rigid` (F, B, 13) are the numbers of the rigid bodies.
        """
        count = len(self.points)
        types, mass = solver.materials.astype(np.int64), solver.mass
        for index, (body, points) in enumerate(zip(solver.scene.rigid, self.bodies, strict=True)):
            x = np.concatenate([x, placed(points, rigid[:, index]).astype(np.float32)], axis=1)
            types = np.concatenate([types, np.full(len(points), RIGID, np.int64)])
            mass = np.concatenate([mass, np.full(len(points), body.mass / len(points), np.float32)])
        if force is not None:
            added = np.zeros((len(force), len(types) - force.shape[1], x.shape[2]), np.float32)
            force = np.concatenate([force, added], axis=1)
        return Trajectory(
            positions=self.placed(x),
            types=np.concatenate([types, np.full(count, KINEMATIC, np.int64)]),
            force=None if force is None else self.still(force),
            mass=np.concatenate([mass, np.zeros(count, np.float32)]),
            seed=seed,
            scene=solver.scene,
            control=control,
            place=Place(f"seed {seed}"),
        )

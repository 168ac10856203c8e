"""Numbers of a scene that the plain solvers share: steps, walls, and the constants of water and sand."""

import math

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError
from hybridmpm.scene import Sand, Scene, Water

_Floats = npt.NDArray[np.float32]

SMALLEST_STRETCH = 1.0e-4
"""Smallest stretch of sand, the same as in our solver: its logarithm stays finite."""
LOSS = 5.0
"""Compression that sand gives up over its expansion beyond slow flow, the same as in our solver."""


class Constants:
    """Constants of a scene of one material, water or sand, without obstacles; walls are taken as separating.

    Parameters
    ----------
    scene : Scene
    substeps : int
        Equal substeps a frame.

    Raises
    ------
    ConfigError
        The scene has several materials, another one than water or sand, obstacles, walls that differ, or
        walls less than three cells inside the world box.
    """

    def __init__(self, scene: Scene, substeps: int) -> None:
        material = scene.materials[0]
        if len(scene.materials) > 1 or not isinstance(material, Water | Sand) or scene.obstacles:
            raise ConfigError(
                "plain solvers take scenes of one material, water or sand, and without obstacles; "
                f"got {', '.join(m.kind for m in scene.materials)} and {len(scene.obstacles)} obstacles"
            )
        if scene.walls.faces is not None:
            raise ConfigError("plain solvers take walls that are all alike; got walls.faces")
        self.substeps, self.dim, self.resolution = substeps, scene.dim, scene.resolution
        self.dt, self.dx, self.per_dx = scene.frame_dt / substeps, scene.dx, float(scene.resolution)
        # Nodes at these and beyond lie on or behind the walls.
        self.lowest = [math.floor(s * scene.resolution + 1e-6) for s in scene.walls.lower]
        self.highest = [math.ceil(s * scene.resolution - 1e-6) for s in scene.walls.upper]
        if min(self.lowest) < 2 or max(self.highest) + 3 > scene.resolution:
            raise ConfigError("plain solvers take walls three cells or more inside the world box")
        self.friction = material.wall_friction if scene.walls.friction is None else scene.walls.friction
        self.water = isinstance(material, Water)
        self.bulk_modulus = self.tension = self.mu = self.lam = self.alpha = self.slow = 0.0
        self.volume_correction = material.volume_correction
        if isinstance(material, Water):
            self.bulk_modulus, self.tension = material.stiffness(scene.potential_drop), material.tension
        else:
            e, nu = material.youngs_modulus, material.poisson_ratio
            sin = math.sin(math.radians(material.friction_angle))
            self.mu, self.lam = e / (2 * (1 + nu)), e * nu / ((1 + nu) * (1 - 2 * nu))
            # Yield surface of Drucker-Prager.
            self.alpha = math.sqrt(2 / 3) * 2 * sin / (3 - sin)
            # Sand that expands faster than this gives up compression for good [1/s].
            extent = max(np.subtract(scene.walls.upper, scene.walls.lower))
            self.slow = 2 * math.sqrt(math.hypot(*scene.gravity) / extent)

    def sand_state(self, volume_ratio: _Floats) -> tuple[_Floats, _Floats]:
        """Return F (N, D, D) and Kirchhoff stress (N, D, D) [Pa] of sand with these J (N,), without shear."""
        # Sand bears no tension.
        strain = np.minimum(np.log(volume_ratio), 0)[:, None, None] * np.eye(self.dim) / self.dim
        F = (np.exp(strain) * np.eye(self.dim)).astype(np.float32)
        return F, ((2 * self.mu + self.dim * self.lam) * strain).astype(np.float32)

"""Obstacles as particles of type 3 (kinematic), the form in which networks on particles see obstacles."""

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError
from hybridmpm.scene.scene import Scene

_DEPTH = 3.0
"""Depth [spacings] to which particles fill an obstacle: deeper ones would be no neighbours of any fluid."""


def kinematic_particles(scene: Scene, spacing: float) -> npt.NDArray[np.float32]:
    """Fill the obstacles of a scene, within its walls, with a lattice of points.

    Parameters
    ----------
    scene : Scene
    spacing : float
        Distance between neighbouring points of the lattice [m].

    Returns
    -------
    float32 (K, D)
        Positions of the points [m]; K is 0 where there are no obstacles.

    Raises
    ------
    ConfigError
        An obstacle moves. Data sets store one place for each kinematic particle, the same in all frames.
    """
    if not scene.obstacles:
        return np.empty((0, scene.dim), dtype=np.float32)
    if any(obstacle.motion is not None for obstacle in scene.obstacles):
        raise ConfigError("scenes of data sets may not have moving obstacles; remove `motion` from them")
    axes = [
        np.arange(low + spacing / 2, high, spacing)
        for low, high in zip(scene.walls.lower, scene.walls.upper, strict=True)
    ]
    sites = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, scene.dim).astype(np.float32)
    inside = np.zeros(len(sites), dtype=np.bool_)
    for obstacle in scene.obstacles:
        distance = obstacle.to_native().signed_distance(sites)
        inside |= (distance < 0) & (distance > -_DEPTH * spacing)
    return sites[inside]

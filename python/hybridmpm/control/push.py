"""`push`: a local force, as of a hand that moves through the fluid."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.control.checks import positive, vector
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.simulator import Simulator


@dataclass(frozen=True, eq=False)
class Push:
    """A force that draws particles near a point towards a velocity; use it with `Simulator.advance`."""

    point: Floats
    """Middle (D,) [m]."""
    velocity: Floats
    """Velocity of the hand (D,) [m/s]."""
    radius: float
    """Radius of the force [m]."""
    cap: float
    """Largest acceleration [g]."""

    def __call__(self, simulator: Simulator) -> npt.NDArray[np.float32]:
        """Return the force (N, D) [m/s^2] on a simulator's particles in its present state.

        Raises
        ------
        ConfigError
            `point` or `velocity` have not as many numbers as the scene has dimensions.
        """
        point = vector("point", self.point, simulator.dim)
        velocity = vector("velocity", self.velocity, simulator.dim)
        return _core.push_force(
            simulator.positions,
            simulator.velocities,
            point=point.tolist(),
            velocity=velocity.tolist(),
            radius=self.radius,
            cap=self.cap,
            frame_dt=simulator.scene.frame_dt,
        )


def push(point: npt.ArrayLike, velocity: npt.ArrayLike, radius: float, *, cap: float = 15.0) -> Push:
    """Return a local force that drags the fluid around a point along.

    Particles within `radius` are accelerated by w (velocity - u) / (4 frames), where u is their own velocity
    and w = (1 - r^2 / radius^2)^2 falls from 1 in the middle to 0 at the radius. The force acts from the next
    frame on that is computed with it: `simulator.advance(1, control.push(point, velocity, radius))`.

    Parameters
    ----------
    point : (D,)
        Middle of the region [m].
    velocity : (D,)
        Velocity of the hand [m/s].
    radius : float > 0
        [m].
    cap : float > 0
        Largest acceleration [g = 9.81 m/s^2].

    Raises
    ------
    ConfigError
        A number is not finite or out of range, or the vectors have not 2 or 3 numbers each.
    """
    where = vector("point", point)
    return Push(
        where, vector("velocity", velocity, len(where)), positive("radius", radius), positive("cap", cap)
    )

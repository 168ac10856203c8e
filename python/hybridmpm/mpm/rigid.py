"""`RigidBodies`: where the rigid bodies of a solver are and how they move."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import float64, whole
from hybridmpm.errors import ConfigError

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class RigidBodies:
    """The B rigid bodies of a scene at one instant, in the order of `Scene.rigid`."""

    center: _Floats
    """Centres of mass (B, D) [m]."""
    rotation: _Floats
    """In 2D angles (B,) [rad] in (-pi, pi], anticlockwise; in 3D unit quaternions (B, 4), scalar first.

    0, or 1 0 0 0, is the body as the scene gives it without `rotation`; a cylinder lies along y then.
    """
    velocity: _Floats
    """Velocities of the centres (B, D) [m/s]."""
    angular_velocity: _Floats
    """In 2D (B,), anticlockwise, in 3D (B, 3) [rad/s]."""

    @classmethod
    def of(cls, numbers: _Floats, dim: int) -> Self:
        """Return the bodies with the numbers (B, 13) of `_core.Solver.rigid`."""
        center, turn, velocity, spin = np.split(numbers, (3, 7, 10), axis=1)
        if dim == 2:
            turn = np.arctan2(2 * turn[:, 0] * turn[:, 3], 1 - 2 * turn[:, 3] ** 2)
            spin = spin[:, 2]
        parts = {
            "center": center[:, :dim],
            "rotation": turn,
            "velocity": velocity[:, :dim],
            "angular_velocity": spin,
        }
        for part in parts.values():
            part.flags.writeable = False
        return cls(**parts)

    def grip(self, body: int, point: npt.ArrayLike) -> _Floats:
        """Return where a point (D,) [m] is from the centre of a body, in the body's own frame (D,) [m].

        Raises
        ------
        ConfigError
            There is no such body, or the point has another number of coordinates.
        """
        body = whole("body", body, 0, len(self) - 1)
        place, dim = float64("point", point), self.center.shape[1]
        if place.shape != (dim,):
            raise ConfigError(f"point must have {dim} numbers, got shape {place.shape}")
        arm = place - self.center[body]
        if len(arm) == 2:
            cosine, sine = np.cos(self.rotation[body]), np.sin(self.rotation[body])
            return np.array([cosine * arm[0] + sine * arm[1], cosine * arm[1] - sine * arm[0]])
        # The turn of a vector by the conjugate of a unit quaternion.
        w, axis = self.rotation[body][0], -self.rotation[body][1:]
        across = 2 * np.cross(axis, arm)
        return np.asarray(arm + w * across + np.cross(axis, across))

    def __len__(self) -> int:
        return len(self.center)

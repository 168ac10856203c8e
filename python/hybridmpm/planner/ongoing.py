"""A scene whose particles are where a simulation has brought them."""

import dataclasses

import numpy as np
import numpy.typing as npt
from pydantic import PrivateAttr

from hybridmpm.scene import Particles, Scene

_Floats = npt.NDArray[np.float32]


class Ongoing(Scene):
    """A scene that goes on: a solver of it begins with other positions and velocities than the bodies'.

    What a material remembers beyond that (J, F) begins anew.
    """

    _present: Particles = PrivateAttr()

    @classmethod
    def of(cls, scene: Scene, x: _Floats, v: _Floats) -> "Ongoing":
        """Return the scene with its own particles at `x` (N, D) [m] with velocities `v` (N, D) [m/s]."""
        # The scene has been validated.
        found = cls.model_construct(**{name: getattr(scene, name) for name in Scene.model_fields})
        found._present = dataclasses.replace(Scene.sample(scene), x=x, v=v)  # noqa: SLF001 - of this class
        return found

    def sample(self) -> Particles:
        """Return the particles as they are."""
        return self._present

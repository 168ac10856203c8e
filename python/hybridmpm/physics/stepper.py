"""`Stepper`: what a simulator needs of a learned model, whatever runs it."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm.scene import Scene


class Stepper(Protocol):
    """Goes on by one network step of r_t frames."""

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""

    @property
    def r_t(self) -> int:
        """Frames that one step spans."""

    def check(self, scene: Scene) -> None:
        """Raise `ConfigError`, naming both values, where the scene is not of the kind this was made for."""

    def step(
        self,
        history: npt.NDArray[np.float32],
        types: npt.NDArray[np.int64],
        acceleration: npt.NDArray[np.float32],
        walls: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Return positions (N, D) [m] one step later; they may be anything, NaN among it.

        Parameters
        ----------
        history : (6, N, D)
            Positions [m], r_t frames apart, oldest first.
        types : (N,)
            DeepMind's particle types. Kinematic ones (3) stay where they are.
        acceleration : (N, D)
            Known acceleration [m/s^2], gravity and external, held over the step.
        walls : (2, D)
            Lower and upper corner [m].
        """

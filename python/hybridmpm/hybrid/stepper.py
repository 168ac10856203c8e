"""What the hybrid simulator asks of a network, and the simplest thing that can stand for one."""

from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm.arguments import whole
from hybridmpm.downsampling import checked_ratio
from hybridmpm.scene import Scene

Floats = npt.NDArray[np.float32]


class Stepper(Protocol):
    """A learned simulator that goes on by one network step of `r_t` frames."""

    r_p: float
    """Particles kept over those of the scene, in (0, 1]."""
    r_t: int
    """Frames per network step."""
    HISTORY: ClassVar[int] = 6
    """States that `step` wants."""

    def check(self, scene: Scene) -> None:
        """Raise `ConfigError`, naming both values, where the scene is not of the kind it was trained on."""

    def step(
        self, history: Floats, types: npt.NDArray[np.int64], acceleration: Floats, walls: Floats
    ) -> Floats:
        """Return the positions after `r_t` more frames.

        Parameters
        ----------
        history : float32 (6, N, D)
            Positions [m], `r_t` frames apart, oldest first.
        types : int64 (N,)
            DeepMind's particle types; kinematic particles (3) come last.
        acceleration : float32 (N, D)
            Known acceleration [m/s^2]: gravity and external ones.
        walls : float32 (2, D)
            Lower and upper walls [m].

        Returns
        -------
        float32 (N, D)
            Positions [m]; those of kinematic particles unchanged. They need not be finite.
        """


class FreeFall:
    """The network that predicts nothing: particles keep their velocity but for the known acceleration.

    The rung that every trained network has to beat.

    Parameters
    ----------
    r_p : float in (0, 1]
    r_t : int in [1, 100]
    frame_dt : float
        Length of a frame [s].
    """

    HISTORY: ClassVar[int] = 6

    def __init__(self, r_p: float = 1.0, r_t: int = 1, *, frame_dt: float = 0.0025) -> None:
        self.r_p = checked_ratio(r_p)
        self.r_t = whole("r_t", r_t, 1, 100)
        self._frame_dt = frame_dt

    def check(self, scene: Scene) -> None:
        """Accept every scene, and take its frame length."""
        self._frame_dt = scene.frame_dt

    def step(
        self, history: Floats, types: npt.NDArray[np.int64], acceleration: Floats, walls: Floats
    ) -> Floats:
        """Return the positions after `r_t` more frames; see `Stepper.step`."""
        fluid = (types != 3)[:, None]
        square = np.float32((self.r_t * self._frame_dt) ** 2)
        moved = 2 * history[-1] - history[-2] + acceleration * square
        inside = np.clip(moved, walls[0], walls[1])
        return np.asarray(np.where(fluid, inside, history[-1]), dtype=np.float32)

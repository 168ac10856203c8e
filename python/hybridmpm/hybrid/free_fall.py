"""The simplest thing that can stand for a network."""

import numpy as np
import numpy.typing as npt

from hybridmpm.arguments import whole
from hybridmpm.data.particle_types import KINEMATIC
from hybridmpm.downsampling import checked_ratio
from hybridmpm.scene import Scene

_Floats = npt.NDArray[np.float32]


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

    def __init__(self, r_p: float = 1.0, r_t: int = 1, *, frame_dt: float = 0.0025) -> None:
        self.r_p = checked_ratio(r_p)
        self.r_t = whole("r_t", r_t, 1, 100)
        self._frame_dt = frame_dt

    def check(self, scene: Scene) -> None:
        """Accept every scene, and take its frame length."""
        self._frame_dt = scene.frame_dt

    def step(
        self, history: _Floats, types: npt.NDArray[np.int64], acceleration: _Floats, walls: _Floats
    ) -> _Floats:
        """Return the positions after `r_t` more frames; see `Stepper.step`."""
        fluid = (types != KINEMATIC)[:, None]
        square = np.float32((self.r_t * self._frame_dt) ** 2)
        moved = 2 * history[-1] - history[-2] + acceleration * square
        inside = np.clip(moved, walls[0], walls[1])
        return np.asarray(np.where(fluid, inside, history[-1]), dtype=np.float32)

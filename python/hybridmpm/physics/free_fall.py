"""Free fall, the baseline that every learned model has to beat."""

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.coarse.merging import checked_ratio
from hybridmpm.errors import ConfigError
from hybridmpm.physics.spec import MAX_STRIDE
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC


class FreeFall:
    """Free fall between walls: each particle flies on under the known acceleration alone.

    Particles meet neither each other nor obstacles; walls stop them. It is a `Stepper`.

    Parameters
    ----------
    frame_dt : float
        Length of a frame [s].
    r_p : float in (0, 1]
    r_t : int in [1, 64]

    Raises
    ------
    ConfigError
        A number is out of range.
    """

    def __init__(self, frame_dt: float, *, r_p: float = 1.0, r_t: int = 1) -> None:
        self._frame_dt = frame_dt
        self._r_p, self._r_t = checked_ratio(r_p), whole("r_t", r_t, 1, MAX_STRIDE)

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""
        return self._r_p

    @property
    def r_t(self) -> int:
        """Frames that one step spans."""
        return self._r_t

    def check(self, scene: Scene) -> None:
        """Raise `ConfigError` where the scene's frames are of another length."""
        if scene.frame_dt != self._frame_dt:
            raise ConfigError(
                f"the zero network steps frames of {self._frame_dt:g} s, those of {scene.name} last "
                f"{scene.frame_dt:g} s; build it with the scene's frame_dt"
            )

    def step(
        self,
        history: npt.NDArray[np.float32],
        types: npt.NDArray[np.int64],
        acceleration: npt.NDArray[np.float32],
        walls: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Return positions (N, D) [m] one step later; arguments as in `Stepper`."""
        return free_fall(history, types, acceleration, walls, self._frame_dt * self._r_t)


def free_fall(
    history: npt.NDArray[np.float32],
    types: npt.NDArray[np.int64],
    acceleration: npt.NDArray[np.float32],
    walls: npt.NDArray[np.float32],
    step_dt: float,
) -> npt.NDArray[np.float32]:
    """Return positions (N, D) [m] a step of `step_dt` [s] later; other arguments as in `Stepper.step`."""
    x, before = history[-1], history[-2]
    moved = np.clip(x + (x - before) + acceleration * np.float32(step_dt) ** 2, walls[0], walls[1])
    return np.asarray(np.where((types == KINEMATIC)[:, None], x, moved), dtype=np.float32)

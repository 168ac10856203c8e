"""Networks that fail on purpose: a sound network whose predictions are changed in one way."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC

_Floats = npt.NDArray[np.float32]
_NOISE = 30.0  # standard deviation of a random acceleration, on each axis [m/s^2]

_TIMES = 5.0  # factor of an exaggerated acceleration [-]

Corruption = Callable[[_Floats, _Floats, _Floats, float], _Floats]
"""Positions (N, D) [m] from sound ones, the last two positions (2, N, D), the way that the known acceleration
makes in a step (N, D), and the squared time of a step [s^2]."""


def _random(_sound: _Floats, x: _Floats, way: _Floats, square: float) -> _Floats:
    # Equal states get equal noise.
    rng = np.random.default_rng(x[1].view(np.uint32).astype(np.uint64).sum())
    noise = rng.standard_normal(x[1].shape).astype(np.float32)
    return np.asarray(_fallen(x, way) + np.float32(_NOISE * square) * noise)


def _fallen(x: _Floats, way: _Floats) -> _Floats:
    """Return positions after a step of free fall (N, D) [m]."""
    return np.asarray(x[1] + (x[1] - x[0]) + way)


CORRUPTIONS: dict[str, Corruption] = {
    "nan": lambda sound, *_: np.full_like(sound, np.nan),
    "constant": lambda sound, *_: np.full_like(sound, 0.5),
    "still": lambda _sound, x, *_: x[1],
    "random": _random,
    "times-5": lambda sound, x, way, _: _fallen(x, way) + np.float32(_TIMES) * (sound - _fallen(x, way)),
    "without-gravity": lambda sound, _x, way, _: sound - way,
}
"""Predictions that are not sound, by name."""


def pushed(size: float) -> Corruption:
    """Return a corruption that adds an acceleration [m/s^2] along x to all predictions."""
    return lambda sound, _x, _way, square: sound + np.float32(size * square) * np.eye(sound.shape[1])[0]


class Corrupted:
    """A network with corrupted predictions on a scene; a `Stepper`."""

    def __init__(self, network: Stepper, corruption: Corruption, scene: Scene) -> None:
        self.r_p, self.r_t, self.check = network.r_p, network.r_t, network.check
        self._network, self._corruption = network, corruption
        self._square = (network.r_t * scene.frame_dt) ** 2

    def step(
        self, history: _Floats, types: npt.NDArray[np.int64], acceleration: _Floats, walls: _Floats
    ) -> _Floats:
        """Return positions (N, D) [m] one step later; arguments as in `Stepper`."""
        sound = self._network.step(history, types, acceleration, walls)
        way = acceleration * np.float32(self._square)
        changed = self._corruption(sound, history[-2:], way, self._square)
        return np.asarray(np.where((types == KINEMATIC)[:, None], sound, changed), dtype=np.float32)

"""Networks that fail on purpose: a sound network whose answers are spoilt in one way."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC

_Floats = npt.NDArray[np.float32]
_NOISE = 30.0
"""Standard deviation of a random acceleration, on each axis [m/s^2]."""
_TIMES = 5.0


@dataclass(frozen=True)
class Question:
    """What a network is asked, and what it answers where nothing is spoilt."""

    history: _Floats
    acceleration: _Floats
    dt: float
    """Time of a step [s]."""
    sound: _Floats

    @property
    def fallen(self) -> _Floats:
        """Positions after a step of free fall (N, D) [m]."""
        x, before = self.history[-1], self.history[-2]
        return np.asarray(x + (x - before) + self.acceleration * np.float32(self.dt**2))

    def random(self) -> _Floats:
        """Random numbers (N, D), the same for the same question."""
        rng = np.random.default_rng(self.history[-1].view(np.uint32).astype(np.uint64).sum())
        return rng.standard_normal(self.sound.shape).astype(np.float32)


Spoil = Callable[[Question], _Floats]
"""Says what to answer (N, D) [m] in place of a sound answer."""

CORRUPTIONS: dict[str, Spoil] = {
    "nan": lambda asked: np.full_like(asked.sound, np.nan),
    "constant": lambda asked: np.full_like(asked.sound, 0.5),
    "still": lambda asked: asked.history[-1].copy(),
    "random": lambda asked: asked.fallen + np.float32(_NOISE * asked.dt**2) * asked.random(),
    "times-5": lambda asked: asked.fallen + np.float32(_TIMES) * (asked.sound - asked.fallen),
    "without-gravity": lambda asked: asked.sound - asked.acceleration * np.float32(asked.dt**2),
}
"""What to answer in place of a sound answer, by name."""


def pushed(size: float) -> Spoil:
    """Return what adds an acceleration [m/s^2] along x to all answers."""

    def spoil(asked: Question) -> _Floats:
        push = np.zeros_like(asked.sound)
        push[:, 0] = size * asked.dt**2
        return asked.sound + push

    return spoil


class Corrupted:
    """A network whose answers are spoilt; a `Stepper`.

    Parameters
    ----------
    network : Stepper
        The sound network.
    spoil : Spoil
        What it answers in place of sound answers, such as one of `CORRUPTIONS`.
    scene : Scene
        The scene that it is used on, which tells the length of a frame.
    """

    def __init__(self, network: Stepper, spoil: Spoil, scene: Scene) -> None:
        self._network, self._spoil = network, spoil
        self._dt = network.r_t * scene.frame_dt

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""
        return self._network.r_p

    @property
    def r_t(self) -> int:
        """Frames that one step spans."""
        return self._network.r_t

    def check(self, scene: Scene) -> None:
        """Refuse what the sound network refuses."""
        self._network.check(scene)

    def step(
        self,
        history: npt.NDArray[np.float32],
        types: npt.NDArray[np.int64],
        acceleration: npt.NDArray[np.float32],
        walls: npt.NDArray[np.float32],
    ) -> npt.NDArray[np.float32]:
        """Return positions (N, D) [m] one step later; arguments as in `Stepper`."""
        sound = self._network.step(history, types, acceleration, walls)
        spoilt = self._spoil(Question(history, acceleration, self._dt, sound))
        return np.asarray(np.where((types == KINEMATIC)[:, None], sound, spoilt), dtype=np.float32)

"""The law that leads particles back along their own past: linear-quadratic tracking under a cap."""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.simulator import Simulator

BANDWIDTH = (100.0, 300.0)
"""How fast an error of the position is made up for, at the start and at the end [1/s]."""
_VELOCITY = 1.0
"""Weight of an error of the velocity, over that of an error of the position [-]."""
_ARRIVAL = 100.0
"""Weight of the last position over that of those before it [-]."""
_ROUNDING = 2.0**-22
"""Part by which forces at the cap are made smaller, so that float32 does not round them up beyond it [-]."""
_HALF = 0.5
"""Part of a frame's gain in velocity with which a particle moves in the frame, if the force is steady."""


@dataclass(frozen=True, eq=False)
class Retraced:
    """The force a = aim - k_x x - k_u u that keeps each particle on a way, from where it really is.

    The paper's eq. 2 asks in each frame for the whole gap to the next position. But a force held over a frame
    moves a particle by a dt^2 / 2 only, so what was missing comes back twice with the other sign, and
    grows to hundreds of g. This law minimises the sum of

        w^4 |x - q|^2 + w^2 |u - v|^2 + |a|^2

    over all frames instead, with a hundred times the weight on the last position. q and v are the way's
    positions and their rates of change, w is `BANDWIDTH`. So the force sees ahead: a jump of the velocity, as
    at an impact, is spread over about 1 / w on both sides, and the velocities of a fluid that moves the other
    way at the start are turned round within a few 1 / w. Pressure and friction are not in the plan; they show
    in x and u, which are those of the simulator.

    References
    ----------
    Anderson and Moore, Optimal Control: Linear Quadratic Methods, 1990, chapter 4.
    """

    name: ClassVar[str] = "retraced"
    aim: npt.NDArray[np.float32]
    """(T, N, D) [m/s^2]."""
    gains: Floats
    """k_x [1/s^2] and k_u [1/s] of each frame (T, 2)."""
    end: npt.NDArray[np.float32]
    """Last positions (N, D) [m], which are held once all T frames are over."""
    gravity: Floats
    """(D,) [m/s^2]."""
    cap: float
    """Largest acceleration [m/s^2]; longer ones are shortened to it."""

    @classmethod
    def along(cls, way: Floats, *, frame_dt: float, gravity: Floats, cap: float) -> Self:
        """Return the law of a way.

        Parameters
        ----------
        way : (T + 1, N, D)
            Positions after each frame [m], the start first.
        frame_dt : float
            Length of a frame [s].
        gravity : (D,)
            [m/s^2]
        cap : float
            [m/s^2]
        """
        frames = len(way) - 1
        velocities = np.gradient(way, frame_dt, axis=0)
        step = np.array([[1.0, frame_dt], [0.0, 1.0]])
        push = frame_dt * np.array([_HALF * frame_dt, 1.0])
        bandwidth = np.geomspace(*BANDWIDTH, frames + 1)
        weights = np.stack([bandwidth**4, _VELOCITY * bandwidth**2], axis=1)
        ahead = np.diag(weights[-1] * [_ARRIVAL, 1.0])
        # What is ahead costs z' P z - 2 z' p of the present state z = (x, u); P is `ahead`, p is `pull`.
        pull = [ahead[0, 0] * way[-1], ahead[1, 1] * velocities[-1]]
        aim, gains = np.empty((frames, *way.shape[1:]), np.float32), np.empty((frames, 2))
        for frame in reversed(range(frames)):
            answer = ahead @ push / (1.0 + push @ ahead @ push)
            gains[frame] = answer @ step
            falling = np.outer(ahead @ push, gravity)
            pull = [pull[0] - falling[0], pull[1] - falling[1]]
            share = push / (1.0 + push @ ahead @ push)
            aim[frame] = share[0] * pull[0] + share[1] * pull[1]
            closed = step - np.outer(push, gains[frame])
            wanted = weights[frame]
            pull = [
                closed[0, 0] * pull[0] + closed[1, 0] * pull[1] + wanted[0] * way[frame],
                closed[0, 1] * pull[0] + closed[1, 1] * pull[1] + wanted[1] * velocities[frame],
            ]
            ahead = np.diag(wanted) + step.T @ ahead @ closed
        return cls(aim=aim, gains=gains, end=way[-1].astype(np.float32), gravity=np.asarray(gravity), cap=cap)

    def force(self, simulator: Simulator, index: int) -> npt.NDArray[np.float32]:
        """Return (N, D)."""
        x, u = simulator.positions.astype(np.float64), simulator.velocities.astype(np.float64)
        if index < len(self.aim):
            k_x, k_u = self.gains[index]
            wanted = self.aim[index] - k_x * x - k_u * u
        else:
            k_x, k_u = self.gains[0]
            wanted = k_x * (self.end - x) - k_u * u - self.gravity
        size = np.sqrt((wanted**2).sum(axis=1, keepdims=True))
        largest = self.cap * (1 - _ROUNDING)
        return np.asarray(wanted * np.minimum(1.0, largest / np.maximum(size, 1e-12)), dtype=np.float32)

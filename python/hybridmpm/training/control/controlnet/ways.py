"""The field of accelerations, and the ways on which it leads free bodies: one follows from the other."""

from torch import Tensor

from hybridmpm.control.goal.paths import SHORTEST_FRAMES
from hybridmpm.training.control.controlnet.cases import FRAMES

WAY = 0.2
"""Distance that is one in the network's answer [m]."""


def time_left(step: Tensor, seconds: Tensor) -> Tensor:
    """Return the time to go (N, 1) [s] at a control step (N, 1) in [0, 1], at least 15 frames of 100."""
    return seconds * (1 - step).clamp(min=SHORTEST_FRAMES / FRAMES)


def field_of(way: Tensor, v: Tensor, step: Tensor, seconds: Tensor, gravity: Tensor) -> Tensor:
    """Return the least force that leads free bodies on, and to rest there: 6 d / t^2 - 4 v / t - g.

    Parameters
    ----------
    way : (N, D)
        How far each is to go [m].
    v : (N, D)
        Velocities [m/s].
    step : (N, 1)
        Control step over the number of steps.
    seconds : (N, 1) or ()
        Time of control [s].
    gravity : (N, D) or (D,)
        [m/s^2].
    """
    left = time_left(step, seconds)
    return 6 * way / left**2 - 4 * v / left - gravity


def way_of(field: Tensor, v: Tensor, step: Tensor, seconds: Tensor, gravity: Tensor) -> Tensor:
    """Return how far a force leads (N, D) [m]: the inverse of `field_of`."""
    left = time_left(step, seconds)
    return (field + 4 * v / left + gravity) * left**2 / 6

"""Smoothing of recorded forces over time, as in the paper, and the measure of it."""

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats

SMOOTHING = 0.1
"""The paper's lambda [-]."""
SHARPNESS = 2.0
"""The paper's beta [-]."""

Floats32 = npt.NDArray[np.float32]


def step_cosines(forces: Floats32) -> Floats:
    """Return the cosine between the forces of successive frames, (T - 1, N) for forces (T, N, D).

    It is 0 where one of both is zero.
    """
    a = forces.astype(np.float64)
    sizes = np.sqrt((a**2).sum(axis=2))
    both = sizes[:-1] * sizes[1:]
    dot = (a[:-1] * a[1:]).sum(axis=2)
    return np.asarray(np.divide(dot, both, out=np.zeros_like(both), where=both > 0))


def smoothed(forces: Floats32, *, smoothing: float = SMOOTHING, sharpness: float = SHARPNESS) -> Floats32:
    """Return forces (T, N, D) drawn towards those of the next frame, the more the less both agree.

    a_t - lambda exp(-beta cos(a_t, a_t+1)) (a_t - a_t+1), where the cosine with a zero vector is 0. The last
    frame stays as it is. `smoothing` is lambda, `sharpness` is beta.

    Smoothed forces no longer lead to the end of the recorded motion: nothing closes the loop.

    References
    ----------
    The paper's eq. `control_acceleration_smoothness`.
    """
    share = smoothing * np.exp(-sharpness * step_cosines(forces))[..., None]
    result = forces.astype(np.float64)
    result[:-1] -= share * (result[:-1] - result[1:])
    return result.astype(np.float32)

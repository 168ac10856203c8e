"""The cosine schedule: the share of a sample that is left at each step of the diffusion."""

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole

TRAINING_STEPS = 1000
"""Steps of the diffusion that networks are trained on, as in the paper."""
MAX_STEPS = 20
"""Largest number of steps in which a sample is drawn."""
_OFFSET = 0.008
"""The schedule's s: without it the first steps add next to no noise."""
_LARGEST_BETA = 0.999
"""Largest share of noise that one step adds, so that the last one does not divide by zero."""

Floats = npt.NDArray[np.float64]


def cosine_schedule(steps: int = TRAINING_STEPS) -> Floats:
    """Return alpha_bar_0 to alpha_bar_T (T + 1,): the shares of the sample's variance that are left.

    A sample x_0 of unit variance is x_t = sqrt(alpha_bar_t) x_0 + sqrt(1 - alpha_bar_t) eps after t steps.
    alpha_bar_0 is 1, the sample itself.

    Parameters
    ----------
    steps : int in [1, 100000]
        Number T of steps.

    References
    ----------
    Nichol and Dhariwal, Improved Denoising Diffusion Probabilistic Models, arXiv:2102.09672, Eq. (17): their
    f(t) / f(0), with beta_t clipped at 0.999.
    """
    time = np.arange(whole("steps", steps, 1, 100_000) + 1) / steps
    f = np.cos((time + _OFFSET) / (1 + _OFFSET) * np.pi / 2) ** 2
    kept = np.maximum(f[1:] / f[:-1], 1 - _LARGEST_BETA)
    return np.append(1.0, np.cumprod(kept))


def few_times(steps: int, of: int = TRAINING_STEPS) -> npt.NDArray[np.int64]:
    """Return the times (steps + 1,) of a sampler of few steps: evenly from T down to 0.

    Parameters
    ----------
    steps : int in [1, 20]
        Number of steps of the sampler, i.e. of evaluations of the network.
    of : int >= steps
        Number T of steps of the diffusion.
    """
    steps = whole("steps", steps, 1, MAX_STEPS)
    of = whole("of", of, steps, 100_000)
    return np.linspace(of, 0, steps + 1).round().astype(np.int64)

"""Samplers of few steps: DDIM and DPM-Solver++(2M), for networks that predict the clean sample x_0.

Steps are pure: noise comes in, nothing is remembered.
"""

import itertools
import math
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from hybridmpm.control.diffusion.schedule import cosine_schedule, few_times
from hybridmpm.errors import ConfigError

Solver = Literal["ddim", "dpm"]
SOLVERS: tuple[Solver, ...] = get_args(Solver)

Floats32 = npt.NDArray[np.float32]
Floats = npt.NDArray[np.floating]


def ddim_step(x_t: Floats, x_0: Floats, *, alpha_bar: float, alpha_bar_prev: float) -> Floats:
    """Return the sample one sampler step less noisy, without new noise.

    Parameters
    ----------
    x_t, x_0 : floats of one shape
        The noisy sample, and the clean one as predicted.
    alpha_bar : float in (0, 1)
        Cumulative product at the time of `x_t`.
    alpha_bar_prev : float in [alpha_bar, 1]
        Cumulative product at the next smaller time that the sampler keeps; at 1 the answer is `x_0`.

    References
    ----------
    Song, Meng, Ermon: Denoising Diffusion Implicit Models, arXiv:2010.02502, Eq. (12) with sigma_t = 0. Its
    alpha is our alpha_bar, its eps_theta is (x_t - sqrt(alpha_bar) x_0) / sqrt(1 - alpha_bar).
    """
    eps = (x_t - math.sqrt(alpha_bar) * x_0) / math.sqrt(1 - alpha_bar)
    return math.sqrt(alpha_bar_prev) * x_0 + math.sqrt(1 - alpha_bar_prev) * eps


def dpm_step(
    x_t: Floats,
    x_0: Floats,
    before: Floats | None,
    *,
    alpha_bar: float,
    alpha_bar_prev: float,
    alpha_bar_before: float | None,
) -> Floats:
    """Return the sample one sampler step less noisy, by a multistep method of second order.

    Parameters
    ----------
    x_t, x_0 : floats of one shape
        The noisy sample, and the clean one as predicted now.
    before : array, optional
        The clean sample as predicted one sampler step earlier; without it the step is of first order, which
        is that of `ddim_step`.
    alpha_bar, alpha_bar_prev : float
        As in `ddim_step`.
    alpha_bar_before : float in (0, alpha_bar), optional
        Cumulative product at the time of `before`.

    References
    ----------
    Lu et al., DPM-Solver++, arXiv:2211.01095, Algorithm 2. Its alpha_t is our sqrt(alpha_bar), its sigma_t is
    sqrt(1 - alpha_bar), lambda is log(alpha_t / sigma_t); s is the time of `x_t`, t the next smaller one.
    """
    if before is None or alpha_bar_before is None or alpha_bar_prev >= 1:
        return ddim_step(x_t, x_0, alpha_bar=alpha_bar, alpha_bar_prev=alpha_bar_prev)
    here, there, earlier = (_log_snr(one) for one in (alpha_bar, alpha_bar_prev, alpha_bar_before))
    h, r = there - here, (here - earlier) / (there - here)
    clean = (1 + 1 / (2 * r)) * x_0 - 1 / (2 * r) * before
    shrink = math.sqrt((1 - alpha_bar_prev) / (1 - alpha_bar))
    return shrink * x_t - math.sqrt(alpha_bar_prev) * math.expm1(-h) * clean


def sampled(
    denoised: Callable[[Floats, int], Floats], noise: Floats32, *, steps: int, solver: Solver = "dpm"
) -> Floats:
    """Draw a sample: turn noise into what a network takes for clean.

    Parameters
    ----------
    denoised : callable
        The network: from the noisy sample and its time in [1, 1000] to the clean sample x_0.
    noise : float32
        Normal numbers; they alone decide which sample is drawn.
    steps : int in [1, 20]
        Number of evaluations of the network.
    solver : "ddim" or "dpm"
        First or second order; of one step both are the network's answer to the noise.

    Raises
    ------
    ConfigError
        `steps` or `solver` is out of range.
    """
    if solver not in SOLVERS:
        raise ConfigError(f"solver must be {' or '.join(SOLVERS)}, got {solver!r}")
    alpha_bar, times = cosine_schedule(), few_times(steps)
    x_t: Floats = noise
    before: Floats | None = None
    for index, (time, next_time) in enumerate(itertools.pairwise(times)):
        x_0 = denoised(x_t, int(time))
        kept = {"alpha_bar": float(alpha_bar[time]), "alpha_bar_prev": float(alpha_bar[next_time])}
        if solver == "ddim":
            x_t = ddim_step(x_t, x_0, **kept)
        else:
            earlier = float(alpha_bar[times[index - 1]]) if index else None
            x_t = dpm_step(x_t, x_0, before, alpha_bar_before=earlier, **kept)
        before = x_0
    return x_t


def _log_snr(alpha_bar: float) -> float:
    """Return lambda, half the logarithm of the ratio of signal to noise."""
    return 0.5 * math.log(alpha_bar / (1 - alpha_bar))

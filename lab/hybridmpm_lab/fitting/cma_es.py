"""CMA-ES: search for the minimum of a function without derivatives, over few numbers.

The search is over at most seven numbers, for which these lines replace a dependency on the package `cma`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Minimum:
    """The best point that was tried."""

    x: Floats
    value: float
    trials: int
    """Number of points that were tried."""


def minimise(
    function: Callable[[Floats], float],
    scale: Floats,
    *,
    go_on: Callable[[int], bool],
    seed: int,
) -> Minimum:
    """Minimise a function around 0 by covariance matrix adaptation.

    The point 0 is tried first, so the result is never worse than that.

    Parameters
    ----------
    function : callable
        Value of a point (n,); infinite where there is none.
    scale : (n,)
        First standard deviation of each number.
    go_on : callable
        Asked with the number of trials before each; false ends the search.
    seed : int >= 0
        The same seed and number of trials give the same result.

    References
    ----------
    Hansen: The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, with its default parameters.
    """
    rng = np.random.default_rng(seed)
    n = len(scale)
    count = 4 + int(3 * np.log(n))
    parents = count // 2
    weights = np.log(parents + 0.5) - np.log(np.arange(1, parents + 1))
    weights /= weights.sum()
    effective = 1 / (weights**2).sum()
    c_sigma = (effective + 2) / (n + effective + 5)
    damping = 1 + 2 * max(0.0, np.sqrt((effective - 1) / (n + 1)) - 1) + c_sigma
    c_c = (4 + effective / n) / (n + 4 + 2 * effective / n)
    c_1 = 2 / ((n + 1.3) ** 2 + effective)
    c_mu = min(1 - c_1, 2 * (effective - 2 + 1 / effective) / ((n + 2) ** 2 + effective))
    expected = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))

    mean, sigma, covariance = np.zeros(n), 1.0, np.eye(n)
    path_sigma, path_c = np.zeros(n), np.zeros(n)
    best = Minimum(np.zeros(n), float(function(np.zeros(n))), 1)
    while True:
        values, axes = np.linalg.eigh(covariance)
        root = axes * np.sqrt(np.maximum(values, 1e-20)) @ axes.T
        inverse_root = axes / np.sqrt(np.maximum(values, 1e-20)) @ axes.T
        steps = rng.normal(size=(count, n)) @ root
        found = np.empty(count)
        for row, step in enumerate(steps):
            if not go_on(best.trials):
                return best
            x = scale * (mean + sigma * step)
            found[row] = function(x)
            better = found[row] < best.value
            best = Minimum(x if better else best.x, float(min(found[row], best.value)), best.trials + 1)
        chosen = steps[np.argsort(found, kind="stable")[:parents]]
        step = weights @ chosen
        mean = mean + sigma * step
        path_sigma = (1 - c_sigma) * path_sigma + np.sqrt(c_sigma * (2 - c_sigma) * effective) * (
            inverse_root @ step
        )
        length = float(np.linalg.norm(path_sigma))
        moving = length < (1.4 + 2 / (n + 1)) * expected
        path_c = (1 - c_c) * path_c + moving * np.sqrt(c_c * (2 - c_c) * effective) * step
        covariance = (
            (1 - c_1 - c_mu) * covariance
            + c_1 * np.outer(path_c, path_c)
            + c_mu * (weights[:, None] * chosen).T @ chosen
        )
        sigma *= float(np.exp(min(1.0, c_sigma / damping * (length / expected - 1))))

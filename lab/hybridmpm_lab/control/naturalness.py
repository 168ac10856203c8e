"""Naturalness: how well a classifier separates controlled frames from frames of fluid left alone.

Each frame becomes 13 numbers (`features`). Logistic regression is fitted to two sets of frames, without one
seed of each set, and scores the frames of these. `auc` is the chance that a frame of the first set has a
higher score than one of the second: 0.5 where the sets cannot be told apart, 1 where they always can.
"""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm import radius_graph
from hybridmpm.coarse.splines import Stencils
from hybridmpm.simulator import Simulator

FEATURES = (
    *(f"fill_{percent}" for percent in (5, 25, 50, 75, 95)),
    "surface",
    "pieces",
    *(f"{name}_{percent}" for name in ("divergence", "curl", "shear") for percent in (50, 95)),
)
"""Names of the 13 numbers of a frame."""
LEAST_SEEDS = 50
"""Smallest number of seeds in each set."""
TOLERANCE = 0.05
"""Largest distance from 0.5 of the AUC of two sets of fluid left alone at which the classifier is valid."""

_SURFACE = 0.75  # Fill below which a particle lies at the surface; at a flat one it is a half
_REACH = 1.7  # Distance of particles of one piece, in spacings
_QUIET = 0.1  # Rate [1/s] added to velocity gradients before their logarithm is taken
_RIDGE = 1e-2
_STEPS = 12
_SPLITS = 16

_Floats = npt.NDArray[np.float64]


def features(simulator: Simulator) -> _Floats:
    """Return the 13 numbers of the present frame, in the order of `FEATURES`.

    They are the 5, 25, 50, 75 and 95 % quantiles of the fill, i.e. of the volume of particles over the
    volume of grid around each; the share of the particles with a fill below 0.75; the logarithm of the number
    of pieces, sets of particles less than 1.7 spacings apart; and the logarithms of the 50 and 95 %
    quantiles, over grid nodes, of |divergence|, |curl| and shear of the velocity [1/s], plus 0.1.
    """
    x, scene = simulator.positions, simulator.scene
    stencils = Stencils.at(x, scene.resolution)
    count = stencils.scatter(np.ones(len(x)))
    fill = stencils.gather(count) * (scene.spacing * scene.resolution) ** scene.dim
    rates = _rates(stencils, count, simulator.velocities, scene.resolution)
    return np.array(
        [
            *np.quantile(fill, (0.05, 0.25, 0.5, 0.75, 0.95)),
            np.mean(fill < _SURFACE),
            np.log(_pieces(x, _REACH * scene.spacing)),
            *(value for rate in rates for value in np.log(np.quantile(rate, (0.5, 0.95)) + _QUIET)),
        ]
    )


def auc(first: Sequence[_Floats], second: Sequence[_Floats]) -> float:
    """Return how well held-out frames of two sets can be told apart, from 0.5 (not at all) to 1.

    Parameters
    ----------
    first, second : sequences of float (K, 13)
        Frames of each seed. Each round holds out one seed of each set; the shorter set is repeated until
        every seed was held out.
    """
    ones, others = [], []
    for index in range(max(len(first), len(second))):
        held = index % len(first), index % len(second)
        training = [
            np.concatenate([*one[:k], *one[k + 1 :]]) for one, k in zip((first, second), held, strict=True)
        ]
        score = _fitted(*training)
        ones.append(score(first[held[0]]))
        others.append(score(second[held[1]]))
    # Equal scores count half.
    high, low = np.concatenate(ones), np.sort(np.concatenate(others))
    below = np.searchsorted(low, high, "left") + np.searchsorted(low, high, "right")
    return float(below.mean() / 2 / len(low))


def real_against_real(seeds: Sequence[_Floats]) -> float:
    """Return the mean `auc` of random halves of uncontrolled seeds; 0.5 for a valid classifier."""
    rng = np.random.default_rng(0)
    half = len(seeds) // 2
    found = []
    for _ in range(_SPLITS):
        order = rng.permutation(len(seeds))
        parts = order[:half], order[half : 2 * half]
        found.append(auc(*([seeds[k] for k in part] for part in parts)))
    return float(np.mean(found))


def _rates(
    stencils: Stencils, count: _Floats, v: npt.NDArray[np.floating], resolution: int
) -> tuple[_Floats, _Floats, _Floats]:
    """Return |divergence|, |curl| and shear (K,) [1/s] in nodes whose neighbours all have mass."""
    dim = v.shape[1]
    filled = count > 0.05 * count.max()
    inner = filled.copy()
    for axis in range(dim):
        inner &= np.roll(filled, 1, axis) & np.roll(filled, -1, axis)
    if not inner.any():
        nothing = np.zeros(1)
        return nothing, nothing, nothing
    safe = np.where(count > 0, count, 1.0)
    gradient = np.empty((int(inner.sum()), dim, dim))
    for row in range(dim):
        field = stencils.scatter(np.asarray(v[:, row], dtype=np.float64)) / safe
        for axis in range(dim):
            slope = (np.roll(field, -1, axis) - np.roll(field, 1, axis)) * resolution / 2
            gradient[:, row, axis] = slope[inner]
    divergence = np.trace(gradient, axis1=1, axis2=2)
    spin = (gradient - gradient.transpose(0, 2, 1)) / 2
    strain = (gradient + gradient.transpose(0, 2, 1)) / 2 - divergence[:, None, None] / dim * np.eye(dim)
    curl, shear = (np.sqrt((part**2).sum(axis=(1, 2))) for part in (spin, strain))
    return np.abs(divergence), curl, shear


def _pieces(x: npt.NDArray[np.floating], reach: float) -> int:
    """Return the number of sets of points (N, D) that are connected by distances up to `reach`."""
    graph = radius_graph(np.ascontiguousarray(x, dtype=np.float32), reach, self_edges=True)
    starts, senders = graph.starts[:-1].astype(np.int64), graph.senders
    labels = np.arange(len(x))
    while True:
        lowest = np.minimum.reduceat(labels[senders], starts)
        lowest = lowest[lowest]
        if np.array_equal(lowest, labels):
            return len(np.unique(labels))
        labels = lowest


def _fitted(first: _Floats, second: _Floats) -> Callable[[_Floats], _Floats]:
    """Fit logistic regression by Newton's method, both sets of the same weight; return the score."""
    both = np.concatenate([first, second])
    mean, scale = both.mean(axis=0), np.maximum(both.std(axis=0), 1e-9)
    rows = np.column_stack([(both - mean) / scale, np.ones(len(both))])
    wanted = np.repeat([1.0, 0.0], [len(first), len(second)])
    share = np.repeat([0.5 / len(first), 0.5 / len(second)], [len(first), len(second)])
    ridge = _RIDGE * np.eye(rows.shape[1])
    ridge[-1, -1] = 0
    w = np.zeros(rows.shape[1])
    for _ in range(_STEPS):
        chance = 1 / (1 + np.exp(-np.clip(rows @ w, -30, 30)))
        slope = rows.T @ (share * (chance - wanted)) + ridge @ w
        bend = (rows * (share * chance * (1 - chance))[:, None]).T @ rows + ridge
        w -= np.linalg.solve(bend + 1e-9 * np.eye(len(w)), slope)
    return lambda frames: np.asarray((frames - mean) / scale @ w[:-1] + w[-1])

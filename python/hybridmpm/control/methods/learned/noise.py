"""Noise from which a transport network begins: normal numbers that vary smoothly in space."""

import numpy as np

from hybridmpm.coarse.splines import Stencils
from hybridmpm.control.goal.cloud import Floats

_CELLS = (1, 3, 6)
"""Cells of the grids over the box between the walls whose noises are added."""


def smooth_noise(rng: np.random.Generator, places: Floats) -> Floats:
    """Return normal numbers (P, D) at places (P, D) between the walls, from -1 to 1.

    Each has mean 0 and variance 1. Those of neighbouring places are nearly the same, as are the ways of
    neighbouring particles: noise of each particle by itself would tear the fluid apart.
    """
    parts = [_on_grid(rng, (places + 1) / 2, cells) for cells in _CELLS]
    return np.asarray(np.sum(parts, axis=0) / np.sqrt(len(_CELLS)))


def _on_grid(rng: np.random.Generator, x: Floats, cells: int) -> Floats:
    x = np.clip(x, 0.0, 1.0)
    stencils = Stencils.at(x, cells)
    grids = rng.standard_normal((x.shape[1], *stencils.shape))
    values = np.stack([stencils.gather(grid) for grid in grids], axis=1)
    # Weights are products over axes, and so are sums of their squares.
    variance = np.prod([_variance(Stencils.at(along[:, None], cells)) for along in x.T], axis=0)
    return np.asarray(values / np.sqrt(variance)[:, None])


def _variance(stencils: Stencils) -> Floats:
    """Return the sum of the squared weights of each point (N,) along an axis."""
    # A clamped node counts twice, so the weights of equal nodes are added before they are squared.
    same = stencils.nodes[:, :, None] == stencils.nodes[:, None, :]
    return np.asarray(np.einsum("ni,nij,nj->n", stencils.weights, same, stencils.weights))

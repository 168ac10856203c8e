"""Distance between particles by transport along lines: quick, and without a solver."""

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError
from hybridmpm.metrics.particles import checked_particles

_LEVELS = (np.arange(128) + 0.5) / 128
"""Parts of the mass at which quantiles are compared."""

_Floats = npt.NDArray[np.float64]


def sliced_distance(
    predicted: npt.ArrayLike, predicted_mass: npt.ArrayLike, true: npt.ArrayLike, true_mass: npt.ArrayLike
) -> _Floats:
    """Return the sliced Wasserstein distance, how far mass has to move as seen along fixed directions.

    Along each of 8 directions in 2D, 12 in 3D, the quantiles of both masses are compared. Their root mean
    square difference is scaled by sqrt(D), so that the distance of a state that is shifted as a whole is the
    length of the shift.

    Parameters
    ----------
    predicted, true : (N, D) or (F, N, D)
        Positions [m]; N may differ.
    predicted_mass, true_mass : (N,)
        Masses [kg], > 0.

    Returns
    -------
    float64 () or (F,), >= 0
        Distance [m].

    Raises
    ------
    ConfigError
        A shape is wrong, or a value is out of range.

    References
    ----------
    Bonneel et al. 2015, "Sliced and Radon Wasserstein barycenters of measures".
    """
    p, p_mass = checked_particles("predicted", predicted, predicted_mass)
    t, t_mass = checked_particles("true", true, true_mass)
    if p.shape[:-2] != t.shape[:-2] or p.shape[-1] != t.shape[-1]:
        raise ConfigError(f"predicted and true must have as many frames and axes, got {p.shape}, {t.shape}")
    pairs = zip(p.reshape(-1, *p.shape[-2:]), t.reshape(-1, *t.shape[-2:]), strict=True)
    apart = [_quantiles(one, p_mass) - _quantiles(two, t_mass) for one, two in pairs]
    return np.array([np.sqrt(p.shape[-1] * np.mean(one**2)) for one in apart]).reshape(p.shape[:-2])


def _quantiles(x: _Floats, mass: _Floats) -> _Floats:
    """Return the quantiles (directions, levels) [m] of the mass along the directions."""
    found = []
    for direction in _directions(x.shape[1]):
        along = x @ direction
        order = np.argsort(along, kind="stable")
        reached = np.cumsum(mass[order])
        found.append(along[order][np.searchsorted(reached, _LEVELS * reached[-1])])
    return np.stack(found)


def _directions(dim: int) -> _Floats:
    """Return unit vectors (n, D), spread evenly over a half circle or half sphere."""
    if dim == 2:
        half_circle = np.arange(8) * np.pi / 8
        return np.stack([np.cos(half_circle), np.sin(half_circle)], axis=1)
    count = 12
    height = (np.arange(count) + 0.5) / count
    angle = np.arange(count) * np.pi * (3 - 5**0.5)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=1)

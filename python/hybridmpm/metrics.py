"""Errors between two states of a scene, read off the mass that their particles leave on a grid.

All three normalise the node masses to m~ = m / sum(m), so that states with different numbers of particles
compare. They are three readings of one formula of the paper (SPEC 7); `grid_rmse` is the default. The
`predicted` and `true` arrays come from `grid_mass` with the same resolution.
"""

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.arguments import float32, whole
from hybridmpm.errors import ConfigError

__all__ = ["EMPTY_BELOW", "grid_mass", "grid_node_error", "grid_nrmse", "grid_rmse"]

EMPTY_BELOW = 1e-3
"""`grid_node_error` counts nodes below this share of the largest true mass as empty."""


def grid_mass(x: npt.ArrayLike, mass: npt.ArrayLike, resolution: int) -> npt.NDArray[np.float32]:
    """Mass of the nodes of a grid over [0, 1]^D, by quadratic B-splines.

    Parameters
    ----------
    x : (N, D) in [0, 1]
        Positions [m].
    mass : (N,)
        [kg].
    resolution : int in [8, 1024]
        Cells along each axis.

    Returns
    -------
    float32, (resolution + 1,) * D
        [kg]; the sum is that of `mass`.

    Raises
    ------
    ConfigError
        Wrong shapes or values out of range.

    References
    ----------
    Jiang et al. 2016, "The material point method for simulating continuum materials", Eq. (123).
    """
    return _native.grid_mass(
        float32("x", x, "(N, D)"), float32("mass", mass, "(N,)"), whole("resolution", resolution, 8, 1024)
    )


def grid_rmse(predicted: npt.ArrayLike, true: npt.ArrayLike) -> float:
    """||m~_pred - m~_true|| / ||m~_true||, the default error.

    Parameters
    ----------
    predicted, true : (n,) * D
        Node masses [kg], as from `grid_mass`.

    Returns
    -------
    float >= 0
        0 for equal states; sqrt(2) for two of the same concentration that share no node.

    Raises
    ------
    ConfigError
        Shapes differ, or a grid holds no mass or a value that is negative or not finite.
    """
    p, t = _normalised(predicted, true)
    return float(np.linalg.norm(p - t) / np.linalg.norm(t))


def grid_nrmse(predicted: npt.ArrayLike, true: npt.ArrayLike) -> float:
    """Root mean square of m~_pred - m~_true over all nodes, divided by the largest m~_true.

    Parameters, range of the arguments and errors are those of `grid_rmse`; the result is >= 0 and shrinks
    with the share of nodes that hold mass.
    """
    p, t = _normalised(predicted, true)
    return float(np.sqrt(np.mean((p - t) ** 2)) / t.max())


def grid_node_error(predicted: npt.ArrayLike, true: npt.ArrayLike) -> float:
    """Mean over all nodes of |m~_pred - m~_true| / m~_true.

    Nodes whose true mass is below `EMPTY_BELOW` of the largest are counted as empty and contribute 0, but
    they count in the mean. Parameters and errors are those of `grid_rmse`; the result is >= 0.
    """
    p, t = _normalised(predicted, true)
    filled = t >= EMPTY_BELOW * t.max()
    return float((np.abs(p - t)[filled] / t[filled]).sum() / t.size)


def _normalised(
    predicted: npt.ArrayLike, true: npt.ArrayLike
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    p, t = np.asarray(predicted, dtype=np.float64), np.asarray(true, dtype=np.float64)
    if p.shape != t.shape:
        raise ConfigError(f"predicted and true must have the same shape, got {p.shape} and {t.shape}")
    for name, grid in (("predicted", p), ("true", t)):
        if not (np.isfinite(grid).all() and (grid >= 0).all() and grid.sum() > 0):
            raise ConfigError(f"{name} must hold finite masses >= 0 kg, and some above 0")
    return p / p.sum(), t / t.sum()

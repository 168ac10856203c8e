"""Errors between two states of a scene, from the masses that their particles put on the nodes of a grid.

All three errors normalise the node masses to m~ = m / sum(m), so that states with different numbers of
particles can be compared. They are three readings of one published formula, "the mean over nodes of
|m~_pred - m~_true| / m~_true"; `grid_rmse` is the default. The arrays `predicted` and `true` come from
`grid_mass` with the same resolution.
"""

from collections.abc import Sequence
from typing import overload

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import float32, float64, whole
from hybridmpm.errors import ConfigError

EMPTY_BELOW = 1e-3
"""Fraction of the largest true mass below which `grid_node_error` counts a node as empty."""

_Floats = npt.NDArray[np.float64]


def grid_mass(
    x: npt.ArrayLike, mass: npt.ArrayLike, resolution: int, cells: Sequence[int] | None = None
) -> npt.NDArray[np.float32]:
    """Return the masses of the nodes of a grid over a world, by quadratic B-splines.

    Parameters
    ----------
    x : (N, D) or (F, N, D), inside the world
        Positions [m] of one state or of F frames.
    mass : (N,)
        Masses of the particles [kg].
    resolution : int in [1, 1000000], without `cells` in [8, 4096]
        Number of cells per metre.
    cells : D integers in [8, 4096], optional
        Number of cells along each axis, as `Scene.cells`; those of one metre if absent.

    Returns
    -------
    float32, one more than `cells` along each axis, or (F, ...) of F frames
        Masses of the nodes [kg]; the sum over a grid is that of `mass`.

    Raises
    ------
    ConfigError
        A shape is wrong, or a value is out of range.

    References
    ----------
    Jiang et al. 2016, "The material point method for simulating continuum materials", Eq. (123).
    """
    positions, masses = float32("x", x, "(N, D)", "(F, N, D)"), float32("mass", mass, "(N,)")
    resolution = whole("resolution", resolution, 1, 1_000_000)
    dim = positions.shape[-1]
    counts = grid_cells(dim, resolution, cells)
    if positions.ndim == 2:
        return _core.grid_mass(positions, masses, resolution, counts)
    grids = np.empty((len(positions), *(count + 1 for count in counts)), dtype=np.float32)
    for grid, frame in zip(grids, positions, strict=True):
        grid[...] = _core.grid_mass(frame, masses, resolution, counts)
    return grids


def grid_cells(dim: int, resolution: int, cells: Sequence[int] | None) -> tuple[int, ...]:
    """Return the checked numbers of cells along each axis: `cells`, or without them those of one metre."""
    if cells is None:
        return (whole("resolution", resolution, 8, 4096),) * dim
    if len(cells) != dim:
        raise ConfigError(f"cells must have {dim} numbers, got {cells!r}")
    return tuple(whole("cells", count, 8, 4096) for count in cells)


@overload
def grid_rmse(predicted: npt.ArrayLike, true: npt.ArrayLike) -> float: ...
@overload
def grid_rmse(predicted: npt.ArrayLike, true: npt.ArrayLike, *, dim: int) -> _Floats: ...
def grid_rmse(predicted: npt.ArrayLike, true: npt.ArrayLike, *, dim: int | None = None) -> float | _Floats:
    """Return ||m~_pred - m~_true|| / ||m~_true||, the default error.

    Parameters
    ----------
    predicted, true : (n,) * D, or (F, n, ...) with `dim`
        Node masses [kg], as from `grid_mass`.
    dim : int >= 1, optional
        Number of axes of a grid, which are the last ones; the axes before them count frames. If absent, all
        axes are the grid's.

    Returns
    -------
    float >= 0, or float64 (F,) with `dim`
        Error [-]: 0 for equal states, sqrt(2) for states of equal ||m~|| that have no node in common.

    Raises
    ------
    ConfigError
        Shapes differ; or a grid has no mass, or a value that is negative or not finite.
    """
    p, t = _normalised(predicted, true, dim)
    return _shaped(np.linalg.norm(p - t, axis=-1) / np.linalg.norm(t, axis=-1), dim)


@overload
def grid_nrmse(predicted: npt.ArrayLike, true: npt.ArrayLike) -> float: ...
@overload
def grid_nrmse(predicted: npt.ArrayLike, true: npt.ArrayLike, *, dim: int) -> _Floats: ...
def grid_nrmse(predicted: npt.ArrayLike, true: npt.ArrayLike, *, dim: int | None = None) -> float | _Floats:
    """Return the root mean square of m~_pred - m~_true over all nodes, divided by the largest m~_true.

    Parameters and errors are those of `grid_rmse`. The result is >= 0 [-]; the fewer of the nodes have mass,
    the smaller it is.
    """
    p, t = _normalised(predicted, true, dim)
    return _shaped(np.sqrt(np.mean((p - t) ** 2, axis=-1)) / t.max(axis=-1), dim)


@overload
def grid_node_error(predicted: npt.ArrayLike, true: npt.ArrayLike) -> float: ...
@overload
def grid_node_error(predicted: npt.ArrayLike, true: npt.ArrayLike, *, dim: int) -> _Floats: ...
def grid_node_error(
    predicted: npt.ArrayLike, true: npt.ArrayLike, *, dim: int | None = None
) -> float | _Floats:
    """Return the mean over all nodes of |m~_pred - m~_true| / m~_true.

    A node whose true mass is below `EMPTY_BELOW` of the largest counts as empty: it enters the mean as 0.
    Parameters and errors are those of `grid_rmse`. The result is >= 0 [-].
    """
    p, t = _normalised(predicted, true, dim)
    filled = t >= EMPTY_BELOW * t.max(axis=-1, keepdims=True)
    relative = np.divide(np.abs(p - t), t, out=np.zeros_like(t), where=filled)
    return _shaped(relative.mean(axis=-1), dim)


def _normalised(predicted: npt.ArrayLike, true: npt.ArrayLike, dim: int | None) -> tuple[_Floats, _Floats]:
    """Return m~ of `predicted` and of `true`, (nodes,) or (F, nodes)."""
    p, t = float64("predicted", predicted), float64("true", true)
    if p.shape != t.shape:
        raise ConfigError(f"predicted and true must have the same shape, got {p.shape} and {t.shape}")
    before = 0 if dim is None else p.ndim - whole("dim", dim, 1, p.ndim)
    rows = []
    for name, grid in (("predicted", p), ("true", t)):
        flat = grid.reshape(*grid.shape[:before], -1)
        sums = flat.sum(axis=-1, keepdims=True)
        if not (np.isfinite(flat).all() and (flat >= 0).all() and (sums > 0).all()):
            raise ConfigError(f"{name} must have finite masses >= 0 kg, and some above 0")
        rows.append(flat / sums)
    return rows[0], rows[1]


def _shaped(errors: _Floats, dim: int | None) -> float | _Floats:
    return float(errors) if dim is None else errors

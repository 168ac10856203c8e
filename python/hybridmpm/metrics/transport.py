"""Optimal transport between particles, by the library POT."""

from types import ModuleType

import numpy as np
import numpy.typing as npt

from hybridmpm.downsampling.clustering import balanced_clusters
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.metrics.particles import checked_particles

MAX_POINTS = 500
"""More particles are merged into so many clusters first: the cost grows with their square."""
BLUR = 0.05
"""Default length of the entropic smoothing [m]."""

_ITERATIONS = 10_000
_MARGINAL_ERROR = 1e-5
"""Norm of what the marginals miss at which the iteration stops; the dual value is off by about its square."""
_LARGEST_MARGINAL_ERROR = 1e-4
"""Still taken after the last round: a few drops far from all else settle slowly and count for little."""

_Floats = npt.NDArray[np.float64]


def sinkhorn_distance(
    predicted: npt.ArrayLike,
    predicted_mass: npt.ArrayLike,
    true: npt.ArrayLike,
    true_mass: npt.ArrayLike,
    *,
    blur: float = BLUR,
) -> _Floats:
    """Square root of the Sinkhorn divergence, a smoothed root mean square distance that mass has to move.

    With the cost |x - y|^2, entropic regularisation eps = blur^2, and the optimal value OT_eps that includes
    the relative entropy to the product of both measures, the divergence is
    OT_eps(p, t) - OT_eps(p, p) / 2 - OT_eps(t, t) / 2. Masses are divided by their sums.

    Parameters
    ----------
    predicted, true : (N, D) or (F, N, D)
        Positions [m]; N may differ. More than 500 are merged into 500 balanced clusters.
    predicted_mass, true_mass : (N,)
        [kg], > 0.
    blur : float in [0.01, 1]
        [m]; smaller is sharper and slower.

    Returns
    -------
    float64 () or (F,), >= 0
        [m]; 0 for equal states, and the length of the shift for one state shifted as a whole.

    Raises
    ------
    ConfigError
        POT is not installed, wrong shapes, or a value out of range.
    SimulationError
        The iteration did not converge.

    References
    ----------
    Feydy et al. 2019, "Interpolating between optimal transport and MMD using Sinkhorn divergences", Eq. (3);
    Flamary et al. 2021, "POT: Python optimal transport".
    """
    solver = _pot()
    if not 0.01 <= blur <= 1:
        raise ConfigError(f"blur must be in [0.01, 1] m, got {blur:g}")
    p, p_mass = checked_particles("predicted", predicted, predicted_mass)
    t, t_mass = checked_particles("true", true, true_mass)
    if p.shape[:-2] != t.shape[:-2] or p.shape[-1] != t.shape[-1]:
        raise ConfigError(f"predicted and true must have as many frames and axes, got {p.shape}, {t.shape}")
    pairs = zip(p.reshape(-1, *p.shape[-2:]), t.reshape(-1, *t.shape[-2:]), strict=True)
    distances = [_divergence(solver, (one, p_mass), (two, t_mass), blur**2) ** 0.5 for one, two in pairs]
    return np.array(distances).reshape(p.shape[:-2])


def _pot() -> ModuleType:
    try:
        import ot  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("the Sinkhorn distance needs POT: pip install 'hybridmpm[metrics]'") from None
    return ot  # type: ignore[no-any-return]  # it has no types


def _divergence(
    solver: ModuleType, one: tuple[_Floats, _Floats], two: tuple[_Floats, _Floats], eps: float
) -> float:
    """Add that of the centres of mass to that of the centred rest: with squares the split is exact."""
    (x, a), shift_one = _centred(*_few(*one))
    (y, b), shift_two = _centred(*_few(*two))
    apart = float(((shift_one - shift_two) ** 2).sum())
    itself = _transport(solver, (x, a), (x, a), eps) + _transport(solver, (y, b), (y, b), eps)
    # What iteration leaves of zero may be below it.
    return apart + max(0.0, _transport(solver, (x, a), (y, b), eps) - itself / 2)


def _few(x: _Floats, mass: _Floats) -> tuple[_Floats, _Floats]:
    if len(x) <= MAX_POINTS:
        return x, mass / mass.sum()
    labels = balanced_clusters(x, MAX_POINTS)
    merged: _Floats = np.bincount(labels, mass).astype(np.float64)
    return np.stack([np.bincount(labels, mass * axis) for axis in x.T], axis=1) / merged[
        :, None
    ], merged / merged.sum()


def _centred(x: _Floats, mass: _Floats) -> tuple[tuple[_Floats, _Floats], _Floats]:
    centre: _Floats = mass @ x
    return (x - centre, mass), centre


def _transport(
    solver: ModuleType, one: tuple[_Floats, _Floats], two: tuple[_Floats, _Floats], eps: float
) -> float:
    """OT_eps by its dual: the potentials f = eps log(u / a), g = eps log(v / b) of POT's scalings u, v."""
    (x, a), (y, b) = one, two
    squares = (x**2).sum(axis=1)[:, None] + (y**2).sum(axis=1) - 2 * x @ y.T
    _, log = solver.sinkhorn(
        a,
        b,
        np.maximum(squares, 0.0),
        eps,
        numItermax=_ITERATIONS,
        stopThr=_MARGINAL_ERROR,
        log=True,
        warn=False,
    )
    u, v = log["u"], log["v"]
    if not (log["err"][-1] <= _LARGEST_MARGINAL_ERROR and (u > 0).all() and (v > 0).all()):
        raise SimulationError(
            f"the Sinkhorn iteration did not converge: its marginals are off by {log['err'][-1]:.1e} after "
            f"{_ITERATIONS} rounds; take a larger blur than {eps**0.5:g} m"
        )
    return float(eps * (a @ np.log(u / a) + b @ np.log(v / b)))

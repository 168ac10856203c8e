"""Distance between particles by optimal transport, computed by the library POT."""

from types import ModuleType

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.merging import balanced_clusters
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.metrics.particles import checked_particles

MAX_POINTS = 500
"""Largest number of points; more particles are first merged into so many clusters.

The cost grows with the square of the number of points.
"""
BLUR = 0.05
"""Default length of the entropic smoothing [m]."""

_ITERATIONS = 10_000
"""Largest number of rounds of the iteration."""
_MARGINAL_ERROR = 1e-5
"""Norm of the marginals' error at which the iteration stops; the dual value's error is about its square."""
_LARGEST_MARGINAL_ERROR = 1e-4
"""Largest such norm that is accepted after the last round: a few drops far away settle slowly."""

_Floats = npt.NDArray[np.float64]


def sinkhorn_distance(
    predicted: npt.ArrayLike,
    predicted_mass: npt.ArrayLike,
    true: npt.ArrayLike,
    true_mass: npt.ArrayLike,
    *,
    blur: float = BLUR,
) -> _Floats:
    """Return the square root of the Sinkhorn divergence, a smoothed distance that the mass has to move.

    The divergence is OT_eps(p, t) - OT_eps(p, p) / 2 - OT_eps(t, t) / 2. Here p and t are the masses over
    their sums, and OT_eps is the optimal value for the cost |x - y|^2 with the entropic regularisation
    eps = blur^2, the relative entropy to the product of both measures included. Without smoothing, its root
    would be the root mean square distance that the mass has to move.

    Parameters
    ----------
    predicted, true : (N, D) or (F, N, D)
        Positions [m]; N may differ. More than 500 particles are merged into 500 balanced clusters.
    predicted_mass, true_mass : (N,)
        Masses [kg], > 0.
    blur : float in [0.01, 1]
        Length of the smoothing [m]; smaller is sharper and slower.

    Returns
    -------
    float64 () or (F,), >= 0
        Distance [m]: 0 for equal states, and the length of the shift for a state that is shifted as a whole.

    Raises
    ------
    ConfigError
        POT is not installed, a shape is wrong, or a value is out of range.
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
    """Return the Sinkhorn divergence of two weighted sets of points.

    It is the squared distance of the centres of mass plus the divergence of the centred sets, which is exact
    for a squared cost.
    """
    (x, a), shift_one = _centred(*_few(*one))
    (y, b), shift_two = _centred(*_few(*two))
    apart = float(((shift_one - shift_two) ** 2).sum())
    itself = _transport(solver, (x, a), (x, a), eps) + _transport(solver, (y, b), (y, b), eps)
    # The iteration is not exact, so a divergence of zero may come out negative.
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
    """Return OT_eps by its dual; POT's scalings u, v give the potentials eps log(u / a), eps log(v / b)."""
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

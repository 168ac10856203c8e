"""Measures of a run: its end beside truth and goal, its force beside a lower bound, and its naturalness.

Naturalness is how well a classifier tells a method's frames from those of the oracle, which follows the true
motion: of the same seed, at the same time. Each frame becomes 13 numbers (`features`). Logistic regression is
fitted to the frames of all other seeds, and scores those of this one. `recognised` is the share of pairs in
which the method's frame has the higher score: 0.5 where the two cannot be told apart, 1 where they always
can.
"""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics, radius_graph
from hybridmpm.coarse.splines import Stencils
from hybridmpm.control.goal.cloud import EARTH, Floats
from hybridmpm.control.goal.goal import Goal
from hybridmpm.simulator import Simulator
from hybridmpm_lab.harness.rows import Row

_Positions = npt.NDArray[np.floating]
_GRID_ERRORS = {
    "error": metrics.grid_rmse,
    "nrmse": metrics.grid_nrmse,
    "node_error": metrics.grid_node_error,
}

FEATURES = (
    *(f"fill_{percent}" for percent in (5, 25, 50, 75, 95)),
    "surface",
    "pieces",
    *(f"{name}_{percent}" for name in ("divergence", "curl", "shear") for percent in (50, 95)),
)
"""Names of the 13 numbers of a frame."""
LEAST_SEEDS = 50
"""Smallest number of seeds for a figure."""

_SURFACE = 0.75  # Fill below which a particle lies at the surface; at a flat one it is a half
_REACH = 1.7  # Distance of particles of one piece, in spacings
_QUIET = 0.1  # Rate [1/s] added to velocity gradients before their logarithm is taken
_RIDGE = 1e-2
_STEPS = 12


def end_figures(
    simulator: Simulator, goal: Goal, truth: _Positions | None, x: _Positions, later: _Positions | None
) -> Row:
    """Measure the end of a run, at positions `x` (N, D) [m], and `later` after the goal was held.

    `error`, `nrmse` and `node_error` are `grid_rmse`, `grid_nrmse` and `grid_node_error` against the true
    positions, where there are any. `transport` is the distance [m] of 300 clusters from the truth, or else
    from the filled sketch. `inside` and `inside_later` are shares of the mass in the goal, `centroid_error`
    is the distance [m] of the centre of mass from that of the goal. A figure without a meaning is None.
    """
    mass, scene = simulator.mass, simulator.scene
    errors: Row = dict.fromkeys(_GRID_ERRORS)
    if truth is not None:
        found, true = (metrics.grid_mass(state, mass, scene.resolution, scene.cells) for state in (x, truth))
        errors = {name: measure(found, true) for name, measure in _GRID_ERRORS.items()}
    moved = goal.cloud.weight @ np.asarray(x, dtype=np.float64) - goal.cloud.centroid
    return {
        **errors,
        "transport": metrics.transport_distance(x, mass, goal.paths.places if truth is None else truth, mass),
        "inside": _inside(goal, x),
        "inside_later": None if later is None else _inside(goal, later),
        "centroid_error": float(np.linalg.norm(moved - goal.target_displacement)),
    }


def distance_from_path(centroids: Floats, path: Floats) -> float:
    """Return the mean distance [m] of points (T, D) from a polyline (K, D)."""
    starts, legs = path[:-1], np.diff(path, axis=0)
    square = np.maximum((legs**2).sum(axis=1), 1e-18)
    along = np.einsum("tkd,kd->tk", centroids[:, None] - starts, legs) / square
    nearest = starts + np.clip(along, 0, 1)[..., None] * legs
    return float(np.linalg.norm(centroids[:, None] - nearest, axis=2).min(axis=1).mean())


def force_figures(goal: Goal, forces: Sequence[npt.NDArray[np.float32]]) -> Row:
    """Measure accelerations (D,) or (N, D) [m/s^2] of T frames, beside the least-force bound.

    `rms_g` is the root of their mean square over mass and time, `peak_g` the largest. `bound_g` belongs to
    free bodies that go straight to their places and come to rest there. A group with displacement d and
    velocity u at the start, and T seconds, needs accelerations besides gravity that change linearly from
    a_0 = 6 d / T^2 - 4 u / T - g to a_1 = -6 d / T^2 + 2 u / T - g. The bound is the root of the
    mass-weighted mean of (|a_0|^2 + a_0 . a_1 + |a_1|^2) / 3. All are in g = 9.81 m/s^2; `rms_ratio` is
    `rms_g` over `bound_g`.
    """
    paths, cloud = goal.paths, goal.cloud
    squares = [np.sum(np.asarray(force, dtype=np.float64) ** 2, axis=-1) for force in forces]
    means = [float(cloud.weight @ square) if square.ndim else float(square) for square in squares]
    seconds = len(forces) * cloud.frame_dt
    way = paths.corners[paths.starts[1:] - 1] - paths.corners[paths.starts[:-1]]
    first = 6 * way / seconds**2 - 4 * paths.velocity / seconds - cloud.gravity
    last = -6 * way / seconds**2 + 2 * paths.velocity / seconds - cloud.gravity
    bound = float(np.sqrt(paths.weight @ ((first**2 + first * last + last**2) / 3).sum(axis=1))) / EARTH
    rms = float(np.sqrt(np.mean(means))) / EARTH
    peak = float(np.sqrt(max(square.max() for square in squares))) / EARTH
    return {"rms_g": rms, "peak_g": peak, "bound_g": bound, "rms_ratio": rms / bound}


def _inside(goal: Goal, x: _Positions) -> float | None:
    inside = goal.inside(np.asarray(x, dtype=np.float64))
    return None if inside is None else float(goal.cloud.weight @ inside)


def features(simulator: Simulator) -> Floats:
    """Return the 13 numbers of the present frame, in the order of `FEATURES`.

    They are the 5, 25, 50, 75 and 95 % quantiles of the fill, i.e. of the volume of particles over the
    volume of grid around each; the share of the particles with a fill below 0.75; the logarithm of the number
    of pieces, sets of particles less than 1.7 spacings apart; and the logarithms of the 50 and 95 %
    quantiles, over grid nodes, of |divergence|, |curl| and shear of the velocity [1/s], plus 0.1.
    """
    x, scene = simulator.positions, simulator.scene
    stencils = Stencils.at(x, scene.resolution, scene.cells)
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


def recognised(led: Sequence[Floats], true: Sequence[Floats]) -> float:
    """Return the share of pairs of frames in which the first is recognised; 0.5 if none can be told apart.

    Parameters
    ----------
    led, true : sequences of float (K, 13)
        Frames of each seed, at the same times. Each round holds out one seed.
    """
    found = []
    for k, (one, other) in enumerate(zip(led, true, strict=True)):
        score = _fitted(*(np.concatenate([*frames[:k], *frames[k + 1 :]]) for frames in (led, true)))
        ahead = score(one) - score(other)
        found.append((ahead > 0) + (ahead == 0) / 2)  # equal scores count half
    return float(np.mean(np.concatenate(found)))


def _rates(
    stencils: Stencils, count: Floats, v: npt.NDArray[np.floating], resolution: int
) -> tuple[Floats, Floats, Floats]:
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


def _fitted(first: Floats, second: Floats) -> Callable[[Floats], Floats]:
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

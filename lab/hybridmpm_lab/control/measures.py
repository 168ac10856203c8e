"""Measures of a run: distance from truth and goal at the end, and the force beside a lower bound."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics
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


def end_figures(
    simulator: Simulator, goal: Goal, truth: _Positions | None, x: _Positions, later: _Positions | None
) -> Row:
    """Measure the end of a run.

    Parameters
    ----------
    simulator : Simulator
        Gives the scene and the masses (N,) [kg].
    goal : Goal
        Goal of the sketch.
    truth : (N, D), optional
        True positions [m]; None where the sketch has no truth.
    x : (N, D)
        Positions [m] at the end.
    later : (N, D), optional
        Positions [m] after the goal was held.

    Returns
    -------
    Row
        `error`, `nrmse` and `node_error`: `grid_rmse`, `grid_nrmse` and `grid_node_error` against the truth.
        `transport`: distance [m] of 300 clusters from the truth, or from the filled sketch. `inside` and
        `inside_later`: shares of the mass in the goal. `centroid_error`: distance [m] of the centre of mass
        from that of the goal. A figure without a meaning for the sketch is None.
    """
    mass, resolution = simulator.mass, simulator.scene.resolution
    errors: Row = dict.fromkeys(_GRID_ERRORS)
    if truth is not None:
        found, true = (metrics.grid_mass(state, mass, resolution) for state in (x, truth))
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

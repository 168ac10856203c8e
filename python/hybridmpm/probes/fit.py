"""Pressure at a point: the value there of a linear function fitted to the particles around it.

All particles of a cube count alike. Layers of particles beside a surface differ by up to twice the pressure,
but the grid feels only their means over some cells. So the cube is wider there, and reads what the surface
feels. Particles that crowd at an obstacle, with pressures near zero, count less; those behind it do not.
"""

import numpy as np
import numpy.typing as npt

from hybridmpm.probes.probe import Floats, PressureSamples, Probed, distances

FIT = {"reach": 4.5, "beside": 14.0, "layer": 3.0, "least": 0.25, "condition": 1e3}
"""Lengths in spacings of the particles, and numbers.

`reach` is half of the cube's side far from walls and obstacles, `beside` that up to a distance of `layer`
from them; it falls by one for each spacing farther. At an obstacle's surface particles weigh `least`, and 1
from `1 - least` on. A mean replaces a fit whose matrix has a condition number of `condition` or more.
"""


def fitted_pressure(samples: PressureSamples, point: Floats, simulator: Probed) -> float:
    """Return the pressure at a point (D,) [Pa]; 0 where there is no material."""
    spacing, walls = samples.spacing, simulator.scene.walls
    away = float(min(np.min(point - walls.lower), np.min(np.array(walls.upper) - point)))
    distance = float(distances(point[None], simulator)[0])
    window = _window(point, distance, spacing, simulator)
    far = FIT["beside"] + FIT["layer"] - max(0.0, min(away, distance)) / spacing
    reach = float(np.clip(far, FIT["reach"], FIT["beside"])) * spacing
    near = (np.abs(samples.x - point) < reach).all(axis=1)
    x, pressure = samples.x[near], samples.pressure[near].astype(np.float64)
    offsets = x - point
    weights = np.ones(len(x))
    if window is not None:
        normal, back, front = window
        along = offsets @ normal
        weights = np.clip(FIT["least"] + distances(x, simulator) / spacing, 0.0, 1.0)
        weights[(along < back) | (along > front)] = 0.0
    close = (weights > 0) & (np.abs(offsets) < FIT["reach"] * spacing).all(axis=1)
    if not close.any():
        return 0.0
    mean = float(np.average(pressure[close], weights=weights[close]))
    terms = np.column_stack([np.ones(len(x)), offsets / reach])
    scaled = terms.T * (weights / weights.sum())
    matrix = scaled @ terms
    if close.sum() > 2 * terms.shape[1] and np.linalg.cond(matrix) < FIT["condition"]:
        # Beyond a free surface the function falls below zero, where nothing pulls.
        return max(float(np.linalg.solve(matrix, scaled @ pressure)[0]), min(0.0, mean))
    return mean


def _window(
    point: Floats, distance: float, spacing: float, simulator: Probed
) -> tuple[Floats, float, float] | None:
    """Return the normal (D,) of the nearest obstacle, and from where to where along it particles count [m].

    Both ends lie in the middle of an obstacle, where one is crossed. It is None where none is near.
    """
    widest = FIT["beside"] * spacing * len(point) ** 0.5
    if distance >= widest:
        return None
    step = spacing / 2
    sides = np.concatenate([point + step * np.eye(len(point)), point - step * np.eye(len(point))])
    ahead, behind = distances(sides, simulator).reshape(2, -1)
    slope = ahead - behind
    normal = slope / max(float(np.linalg.norm(slope)), 1e-3 * spacing)
    along: Floats = step * np.arange(1.0, int(widest / step))
    way = along[:, None] * normal
    back, front = (distances(np.concatenate([point - way, point + way]), simulator) <= 0).reshape(2, -1)
    return normal, -_crossed(back, along), _crossed(front, along)


def _crossed(taken: npt.NDArray[np.bool_], along: Floats) -> float:
    """Return the middle [m] of the first obstacle that is left again, by which places `along` are in one."""
    entered = np.flatnonzero(taken)
    if not len(entered):
        return np.inf
    left = np.flatnonzero(~taken[entered[0] :])
    return float(along[entered[0]] + along[entered[0] + left[0] - 1]) / 2 if len(left) else np.inf

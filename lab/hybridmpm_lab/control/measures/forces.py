"""How strong a force was, beside the least that the goal takes, and how much of it is finer than a grid."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.splines import Stencils
from hybridmpm.control.goal.cloud import EARTH, Floats
from hybridmpm.control.goal.goal import Goal
from hybridmpm_lab.harness.rows import Row

FINE_CELLS = 32
"""Cells per metre of the grid that tells fine forces from coarse ones."""
_EVERY = 5
"""Frames between two forces that are filtered."""

_Floats32 = npt.NDArray[np.float32]


def measure_forces(positions: _Floats32, forces: Sequence[_Floats32], weight: Floats) -> Row:
    """Measure the accelerations of T frames; forces (D,) or (N, D) [m/s^2] at positions (T, N, D) [m].

    `rms_g` is the root of their mean square over mass and time, `peak_g` the largest, in g = 9.81 m/s^2.
    `fine_share` is the share of their energy, the sum of mass times square, that does not come through a
    P2G / G2P on a grid of 1/32 m: 1 - |S f|^2 / |f|^2, with the quadratic B-splines of the solver. It is None
    without a force.
    """
    squares = [_energy(force, weight) for force in forces]
    largest = max((float((force**2).sum(axis=-1).max()) for force in forces), default=0.0)
    return {
        "rms_g": float(np.sqrt(np.mean(squares))) / EARTH if squares else 0.0,
        "peak_g": float(np.sqrt(largest)) / EARTH,
        "fine_share": fine_share(positions[::_EVERY], forces[::_EVERY], weight),
    }


def fine_share(positions: _Floats32, forces: Sequence[_Floats32], weight: Floats) -> float | None:
    """Return the share of the energy of forces that a grid of 1/32 m does not carry; see `measure_forces`."""
    whole = coarse = 0.0
    for x, force in zip(positions, forces, strict=True):
        energy = _energy(force, weight)
        whole += energy
        coarse += energy if force.ndim == 1 else _energy(_filtered(x, force, weight), weight)
    return 1 - coarse / whole if whole > 0 else None


def least_force(goal: Goal, frames: int) -> Row:
    """Return the least-force bound of free bodies on straight paths to their places, at rest in the end.

    A group with displacement d and velocity u at the start, and T seconds, needs accelerations besides
    gravity that fall linearly from a_0 = 6 d / T^2 - 4 u / T - g to a_1 = -6 d / T^2 + 2 u / T - g. `bound_g`
    is the root of the mass-weighted mean of (|a_0|^2 + a_0 . a_1 + |a_1|^2) / 3, `bound_peak_g` the largest
    of |a_0| and |a_1|, in g = 9.81 m/s^2.
    """
    paths, cloud = goal.paths, goal.cloud
    seconds = frames * cloud.frame_dt
    way = paths.corners[paths.starts[1:] - 1] - paths.corners[paths.starts[:-1]]
    first = 6 * way / seconds**2 - 4 * paths.velocity / seconds - cloud.gravity
    last = -6 * way / seconds**2 + 2 * paths.velocity / seconds - cloud.gravity
    square = ((first**2 + first * last + last**2) / 3).sum(axis=1)
    peak = max(float((end**2).sum(axis=1).max()) for end in (first, last))
    return {
        "bound_g": float(np.sqrt(paths.weight @ square)) / EARTH,
        "bound_peak_g": float(np.sqrt(peak)) / EARTH,
    }


def _filtered(x: _Floats32, force: _Floats32, weight: Floats) -> Floats:
    stencils = Stencils.at(x, FINE_CELLS)
    mass = stencils.scatter(weight)
    mass[mass == 0] = 1.0
    columns = [stencils.gather(stencils.scatter(weight * column) / mass) for column in force.T]
    return np.stack(columns, axis=1)


def _energy(force: npt.NDArray[np.floating], weight: Floats) -> float:
    square = (np.asarray(force, dtype=np.float64) ** 2).sum(axis=-1)
    return float(weight @ square) if square.ndim else float(square)

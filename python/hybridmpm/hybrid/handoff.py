"""Handoff from a network to MPM: a state with velocities and stress, made from the network's positions."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm.mpm import MpmSolver

STEPS = 2
"""Network steps that MPM repeats. After one the pressure of an impact of 5 m/s has half its value; after two
it is as near as after five."""

_Floats = npt.NDArray[np.float32]


def velocity(path: Sequence[_Floats], row: int, dt: float) -> _Floats:
    """Return the velocity at a position of a path, to second order from this one and the two before.

    Parameters
    ----------
    path : (F, N, D)
        Positions [m], `dt` apart.
    row : int
        Negative, from the end.
    dt : float
        [s].

    Returns
    -------
    float32 (N, D)
        [m/s]; exact for constant acceleration.
    """
    x = np.array([path[row], path[row - 1], path[row - 2]], dtype=np.float64)
    return np.asarray((1.5 * x[0] - 2 * x[1] + 0.5 * x[2]) / dt, dtype=np.float32)


def warm(mpm: MpmSolver, path: Sequence[_Floats], *, r_t: int, start: bytes | None, steps: int) -> None:
    """Bring a solver that a network has driven into a state whose stress fits the motion.

    Stress does not follow from positions: the density of particles at random places varies by a tenth, and
    the pressure of water at rest takes a thousandth. Nor does it follow from the velocity gradient, whose
    errors add up. So MPM repeats the last steps of the network, and is put on the network's positions after
    each. The stress then comes from MPM's own loop, and from the last frame that MPM simulated.

    Parameters
    ----------
    mpm : MpmSolver
        At the last position of `path`, before and after.
    path : (F, N, D)
        The latest positions [m], `r_t` frames apart; at least `steps` + 3.
    r_t : int
    start : bytes, optional
        Snapshot of the solver before the first of the last `steps` steps, where MPM made that state.
    steps : int >= 1
        Steps to repeat.

    Raises
    ------
    SimulationError
        MPM fails; the solver is then in some state between.
    """
    frame, dt = mpm.frame, r_t * mpm.scene.frame_dt
    if start is None:
        mpm.prescribe(path[-1 - steps], velocity(path, -1 - steps, dt), frame - steps * r_t)
    else:
        mpm.restore(start)
    for ago in range(steps - 1, -1, -1):
        mpm.advance(r_t)
        mpm.prescribe(path[-1 - ago], velocity(path, -1 - ago, dt), frame - ago * r_t)

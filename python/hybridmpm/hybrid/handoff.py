"""From the positions of a network to a state that MPM can go on from."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm.mpm import MpmSolver

Handoff = Literal["warm", "shadow", "cold"]
KINDS: tuple[Handoff, ...] = ("warm", "shadow", "cold")

STEPS = 2
"""Network steps that a warm handoff goes through again. One lets the pressure of an impact of 5 m/s arise by
half only; after two it is as near as after five."""

_Floats = npt.NDArray[np.float32]


def velocity(path: Sequence[_Floats], row: int, dt: float) -> _Floats:
    """Velocity at a position of a path, from this one and the two before, to second order.

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

    Positions do not tell the stress: the density of particles at random places varies by a tenth, the
    pressure of water at rest asks for a thousandth. Neither does the velocity gradient, whose errors add up
    as long as nothing leads the stress back. So MPM goes through the last steps of the network once more, and
    is set on its positions after each: the stress arises in MPM's own loop, from that of the last frame that
    MPM simulated.

    Parameters
    ----------
    mpm : MpmSolver
        At the last position of `path`; there it is left.
    path : (F, N, D)
        The latest positions [m], `r_t` frames apart; at least `steps` + 3.
    r_t : int
    start : bytes, optional
        Snapshot of the solver before the first of the last `steps` steps, where MPM made that state.
    steps : int >= 1
        To go through again.

    Raises
    ------
    SimulationError
        MPM cannot follow; the solver is then in some state between.
    """
    frame, dt = mpm.frame, r_t * mpm.scene.frame_dt
    if start is None:
        mpm.prescribe(path[-1 - steps], velocity(path, -1 - steps, dt), frame - steps * r_t)
    else:
        mpm.restore(start)
    for ago in range(steps - 1, -1, -1):
        mpm.advance(r_t)
        mpm.prescribe(path[-1 - ago], velocity(path, -1 - ago, dt), frame - ago * r_t)


def cold(mpm: MpmSolver, fresh: bytes) -> None:
    """Keep positions and velocities alone: all else becomes what it was at frame 0."""
    x, v, frame = mpm.positions, mpm.velocities, mpm.frame
    mpm.restore(fresh)
    mpm.prescribe(x, v, frame, affine=False)

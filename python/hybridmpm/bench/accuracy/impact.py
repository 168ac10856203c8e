"""When a scene's fluid first hits something: before that any simulator of free fall is right."""

import numpy as np

from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver

PUSH = 5.0
"""An acceleration other than gravity above this [m/s^2], half of gravity, is a contact: rounding in free fall
leaves less than 0.1, a body at rest is pushed by 9.8, and impacts push by hundreds."""
SHARE = 0.01
"""Of the particles must be pushed: a face of a body that touches down is more, a stray particle is less."""

LONGEST_FALL = 400
"""Frames: one second, more than any fall between the walls takes."""


def first_impact(solver: MpmSolver, limit: int) -> int:
    """Advance a solver until its particles no longer fall freely.

    Parameters
    ----------
    solver : MpmSolver
        Of a scene without emitters and sinks. Left at the frame returned.
    limit : int
        Frames to look at.

    Returns
    -------
    int
        The first frame over which more than `SHARE` of the particles accelerated otherwise than by gravity,
        by more than `PUSH`. The solver feels a wall or another body from some cells away, so it may be a
        frame or two before the surfaces meet.

    Raises
    ------
    ConfigError
        There was none.
    """
    gravity = np.array(solver.scene.gravity)
    for _ in range(limit):
        before = solver.velocities
        solver.advance(1)
        push = (solver.velocities.astype(np.float64) - before) / solver.scene.frame_dt - gravity
        if np.mean(np.linalg.norm(push, axis=1) > PUSH) > SHARE:
            return solver.frame
    raise ConfigError(f"nothing hits anything in the first {limit} frames of {solver.scene.name}")

"""The first impact of a scene: until then any simulator of free fall is right."""

import numpy as np

from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene

PUSH = 5.0
"""Acceleration besides gravity above which a particle is in contact [m/s^2].

Rounding in free fall leaves less than 0.1, a body at rest is pushed by 9.8, and impacts push by hundreds.
"""
SHARE = 0.01
"""Share of the particles that are in contact in an impact.

A face of a body that touches down is a larger share, a stray particle is a smaller one.
"""

LONGEST_FALL = 400
"""Frames of one second: no fall between the walls takes longer."""


def first_impact(solver: MpmSolver, limit: int) -> int:
    """Advance a solver until its particles no longer fall freely.

    Parameters
    ----------
    solver : MpmSolver
        Solver of a scene without emitters and sinks. It is left at the frame returned.
    limit : int
        Number of frames to look at.

    Returns
    -------
    int
        First frame over which gravity does not explain, by more than `PUSH`, the acceleration of more than
        `SHARE` of the particles. The solver reacts to a wall or another body from some cells away, so this
        frame may be one or two before the surfaces meet.

    Raises
    ------
    ConfigError
        No frame up to the limit has an impact.
    """
    gravity = np.array(solver.scene.gravity)
    for _ in range(limit):
        before = solver.velocities
        solver.advance(1)
        push = (solver.velocities.astype(np.float64) - before) / solver.scene.frame_dt - gravity
        if np.mean(np.linalg.norm(push, axis=1) > PUSH) > SHARE:
            return solver.frame
    raise ConfigError(f"nothing hits anything in the first {limit} frames of {solver.scene.name}")


def first_frame(scene: Scene, earliest: int = 0) -> int:
    """Return the frame from which times and errors count: the first impact, or a later `earliest`."""
    return max(earliest, first_impact(MpmSolver(scene), LONGEST_FALL))

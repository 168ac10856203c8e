"""Checks of a learned plan before it moves anything."""

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.splines import Stencils
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.goal.region import Figure, Region
from hybridmpm.control.goal.room import Room
from hybridmpm.control.methods.method import Task

_OUTSIDE_LENGTH = 0.02
"""Distance from the walls up to which a place outside counts as inside [m]; it is moved to the wall."""
_OUTSIDE = 0.25
"""Largest share of the mass that may have places outside."""
_BLOCKED = 0.1
"""Largest share of the mass on ways through obstacles, or without a way around them."""
_MISSING = 0.25
"""Largest share of the mass that may miss the goal beyond that of the analytic plan."""
_CELLS = 32
"""Cells per metre of the grid on which the density of the places is checked."""
_DENSE = 1.5
"""Density over that at rest from which on a place counts as too dense."""
_TOO_DENSE = 0.4
"""Largest share of the mass that may be too dense, beyond that of the analytic plan."""


def objection(places: Floats, paths: Paths, task: Task) -> str | None:
    """Return the objection to a plan; None if there is none.

    Parameters
    ----------
    places : (N, D)
        Where the particles are to be [m], before they are moved between the walls and out of obstacles.
    paths : Paths
        The paths there.
    task : Task
        With the analytic plan in its goal, against which the plan is held.
    """
    if (reason := _misplaced(places, paths, task.goal.room, task.goal.cloud.weight)) is not None:
        return reason
    goal = task.goal
    weight = goal.cloud.weight
    # The disc at the tip of an arrow is a makeshift for a shape that does not fit there.
    if goal.drawn is not None and goal.region is not None:
        inside, analytic = (
            weight @ _in_view(goal.drawn, goal.region, one.places) for one in (paths, goal.paths)
        )
        if analytic - inside > _MISSING:
            return f"the plan leaves {100 * (analytic - inside):.0f} % of the fluid out of the goal"
    dense = _too_dense(paths.places, task) - _too_dense(goal.paths.places, task)
    if dense > _TOO_DENSE:
        return f"the plan packs {100 * dense:.0f} % of the fluid too densely"
    seconds = task.frames * goal.cloud.frame_dt
    need, least = (one.timed(seconds).effort(goal.cloud.gravity).acceleration for one in (paths, goal.paths))
    if need > max(task.cap, least):
        return f"the plan takes {need:.1f} g, and {task.cap:g} g are allowed"
    return None


def _misplaced(places: Floats, paths: Paths, room: Room, weight: Floats) -> str | None:
    """Return the objection that places lie, or ways lead, where no fluid can be; None if there is none."""
    beyond = np.maximum(room.lower - places, places - room.upper).max(axis=1)
    outside = float(weight @ (beyond > _OUTSIDE_LENGTH))
    if outside > _OUTSIDE:
        return f"the plan leads {100 * outside:.0f} % of the fluid out of the box"
    within = float(weight @ (room.distance(places) < -_OUTSIDE_LENGTH))
    if within > _OUTSIDE:
        return f"the plan ends with {100 * within:.0f} % of the fluid in obstacles"
    blocked = float(paths.weight @ (paths.blocked(room) | paths.cut_off))
    if blocked > _BLOCKED:
        return f"the plan leads {100 * blocked:.0f} % of the fluid through obstacles"
    return None


def _in_view(drawn: Figure, region: Region, places: Floats) -> npt.NDArray[np.bool_]:
    """Return whether places (N, D) lie in the region of what was drawn, in 3D in the front view, (N,)."""
    scale = max(1.0, region.scale)
    if places.shape[1] == 2:
        return region.reaches(places, scale)
    return drawn.covers_drawn(places, scale)


def _too_dense(places: Floats, task: Task) -> float:
    """Return the share of the mass that lies where places are too dense."""
    cloud = task.goal.cloud
    stencils = Stencils.at(places, _CELLS)
    at_rest = len(places) / cloud.volume / _CELLS**cloud.dim
    density = stencils.gather(stencils.scatter(np.ones(len(places)))) / at_rest
    return float(cloud.weight @ (density > _DENSE))

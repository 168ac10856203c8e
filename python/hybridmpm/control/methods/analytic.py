"""Guidance without weights: optimal transport to the goal, and the least force along the ways."""

from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.method import Task
from hybridmpm.simulator import Simulator


class Analytic:
    """Leads each group of particles to its place with the least force that free motion takes.

    The force is computed in each frame from the actual state, so pressure, friction and walls, which the plan
    does not know, are made up for.
    """

    name = "analytic"

    def plan(self, simulator: Simulator, task: Task) -> Tracked:  # noqa: ARG002 - the goal knows the state
        """Return the law along the ways of the goal."""
        return task.tracked(task.goal.ways)

"""Backcasting: the goal gets a shape that the fluid could have come from, by simulating backwards."""

import numpy as np

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.goal import Goal
from hybridmpm.control.goal.moments import fitted, moments
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.laws import Tracked
from hybridmpm.control.methods.method import Task
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm.simulator import Simulator


class Backcast:
    """Negates the velocities, simulates on, and leads the particles to the result, fitted to the sketch.

    Fluid that runs backwards comes to where it may have been. For an oval that state is moved, turned and
    stretched until mean and covariance are those of the evenly filled oval; for an arrow it is moved to the
    tip. Sand is plastic and does not run back, so there the method is worse than optimal transport.

    References
    ----------
    Sivakumaran, Paquette, Mould: Time Reversal and Simulation Merging for Target-Driven Fluid Animation,
    MIG 2022.
    """

    name = "backcast"

    def plan(self, simulator: Simulator, task: Task) -> Tracked:
        """Return the law that leads to the fitted past.

        Raises
        ------
        ConfigError
            The scene has emitters or sinks, so that time cannot run backwards.
        SimulationError
            MPM failed on the way back.
        """
        if simulator.scene.is_open:
            raise ConfigError(
                "backcast needs a scene without emitters and sinks: use the method analytic for this one"
            )
        cloud = task.goal.cloud
        solver = MpmSolver(simulator.scene, r_p=simulator.r_p)
        solver.prescribe(simulator.positions, -simulator.velocities, simulator.frame)
        for _ in range(task.frames):
            task.on_frame()
            solver.advance(1)
        places = _fitted(solver.positions.astype(np.float64), task.goal)
        room = task.goal.room
        places = np.clip(places, room.lower, room.upper)
        return task.tracked(Paths.straight(cloud, places, task.goal.paths.group))


def _fitted(x: Floats, goal: Goal) -> Floats:
    """Move points (N, D) onto the goal: to its mean, and for an oval also to its covariance."""
    mean, covariance = moments(goal.paths.places, goal.cloud.weight)
    return fitted(x, goal.cloud.weight, mean, None if goal.drawn is None else covariance)

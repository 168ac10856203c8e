"""Backcasting: a rival that leads the fluid to a state found by simulating backwards."""

import numpy as np

from hybridmpm.control import Task
from hybridmpm.control.goal.moments import fitted, moments
from hybridmpm.control.goal.paths import Paths
from hybridmpm.control.laws import Tracked
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm.simulator import Simulator


class Backcast:
    """Guidance to the state that the fluid reaches with negated velocities, fitted to the sketch.

    For an oval that state gets the mean and the covariance of the filled oval, for an arrow its mean goes to
    the tip. Sand is plastic and does not run back, so there the method is worse than optimal transport.

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
            raise ConfigError("backcast needs a scene without emitters and sinks: use the method analytic")
        goal = task.goal
        solver = MpmSolver(simulator.scene, r_p=simulator.r_p)
        solver.prescribe(simulator.positions, -simulator.velocities, simulator.frame)
        for _ in range(task.frames):
            task.on_frame()
            solver.advance(1)
        mean, covariance = moments(goal.paths.places, goal.cloud.weight)
        past = solver.positions.astype(np.float64)
        places = fitted(past, goal.cloud.weight, mean, None if goal.drawn is None else covariance)
        places = np.clip(places, goal.room.lower, goal.room.upper)
        return task.tracked(Paths.straight(goal.cloud, places, goal.paths.group))

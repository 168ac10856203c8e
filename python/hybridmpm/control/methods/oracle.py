"""The oracle: control by the true path behind a sketch, a bound for methods that take the sketch alone."""

import numpy as np

from hybridmpm.control.laws import Retraced
from hybridmpm.control.methods.method import Task
from hybridmpm.control.reversal import ReversedCase
from hybridmpm.errors import ConfigError
from hybridmpm.simulator import Simulator


class Oracle:
    """Leads the particles of a reversed case back along their true way.

    `follow(case.simulator(), case.sketch, Oracle(case), frames=case.frames, cap=case.cap).run()` gives
    `case.positions` by `case.forces`, to the bit. A lower cap gives the best that this law does with it.

    Parameters
    ----------
    case : ReversedCase
    """

    name = "oracle"

    def __init__(self, case: ReversedCase) -> None:
        self._case = case

    def plan(self, simulator: Simulator, task: Task) -> Retraced:
        """Return the law along the true way.

        Raises
        ------
        ConfigError
            The simulator is not in the state in which the case starts, or the frames are not those of the
            case.
        """
        case = self._case
        if task.goal.cloud.partial:
            raise ConfigError("the oracle leads all particles: follow without `who`")
        if task.frames != case.frames:
            raise ConfigError(
                f"the oracle has the way of its case, for frames = {case.frames}, got {task.frames}"
            )
        at_start = np.array_equal(simulator.positions, case.positions[0]) and np.array_equal(
            simulator.velocities, case.velocities
        )
        if not at_start:
            raise ConfigError(
                "the oracle has the way of its case alone: follow with case.simulator(), which is in the "
                "state in which that starts"
            )
        return case.law(task.cap)

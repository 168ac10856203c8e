"""Methods under comparison: the library's, the rivals of the suite, and methods of one's own."""

import importlib
import re

import numpy as np

from hybridmpm.control import METHODS, ControlNet, Learned, Method, Task
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


CONSTANT = "constant"
"""The paper's baseline, which all others are compared with."""
ORACLE = "oracle"
"""The reversed forces themselves, which no sketch contains; in the reversed family only."""
FILLED = "filled"
"""No run: the particles lie in the places that the sketch gives them by optimal matching."""
_NAMED: dict[str, Method | None] = {**METHODS, "backcast": Backcast(), ORACLE: None, FILLED: None}
NAMES = tuple(_NAMED)
"""Names of all methods but those of one's own, in the order of the tables."""
_EVALUATIONS = re.compile(r"(controlnet|learned)-(\d{1,2})")

Methods = dict[str, Method | None]
"""Methods by name; None for the oracle, which comes with each case, and for the filled sketch."""


def methods_of(names: tuple[str, ...]) -> Methods:
    """Return methods, the constant force first unless its place is given.

    A name is one of `NAMES`, `controlnet-4` or `learned-4` for four evaluations of the network, or
    `MODULE:ATTRIBUTE`: an object with the surface of `hybridmpm.control.Method`, or a class or function
    that returns one without arguments. Raises a `ConfigError` where there is no such method.
    """
    return dict(map(_method, names if CONSTANT in names else (CONSTANT, *names)))


def takes_part(name: str, family: str) -> bool:
    """Return whether a method runs on the cases of a family.

    Neither generated forces nor the past of a fluid know shapes.
    """
    if family in ("shape", "sequence"):
        return name.partition("-")[0] not in ("none", "controlnet", "backcast", ORACLE)
    return name != ORACLE or family == "reversed"


def _method(name: str) -> tuple[str, Method | None]:
    if name in NAMES:
        return name, _NAMED[name]
    if (found := _EVALUATIONS.fullmatch(name)) is not None:
        count = int(found[2])
        return name, ControlNet(steps=count) if found[1] == "controlnet" else Learned(evaluations=count)
    module, _, attribute = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), attribute)
        made: Method = found() if isinstance(found, type) or not hasattr(found, "plan") else found
        own, _ = made.name, made.plan
    except Exception as error:
        raise ConfigError(
            f"method must be one of {', '.join(NAMES)} or MODULE:ATTRIBUTE, on PYTHONPATH: a method, "
            f"or a class or function that makes one; got {name!r} ({type(error).__name__}: {error})"
        ) from error
    if own in NAMES:
        raise ConfigError(f"the method {name} must have a `name` of its own, got {own!r}")
    return own, made

"""A case made ready: the simulator in the state that was drawn on, and what is known of the end."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import scenarios
from hybridmpm.control import Method, Sketch
from hybridmpm.control.methods.oracle import Oracle
from hybridmpm.control.reversal import reversed_case
from hybridmpm.mpm import MpmSolver
from hybridmpm_lab.control.suite.cases import Case

HORIZON = 100
"""Frames in which reversed cases are led back, as in the paper."""
ORACLE_CAP = 30.0
"""Largest acceleration of a particle by the oracle [g]."""
_APART = 25
"""Frames between two uncontrolled frames."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What every entrant of a case gets, and what it is judged by."""

    case: Case
    simulator: MpmSolver
    """In the state on which the sketch was drawn; entrants get copies."""
    sketch: Sketch
    meant: Sketch
    """What is judged by: the sketch itself, but for the family `hand`, where a hand drew it."""
    frames: int | None
    """Number of frames in which the goal is to be reached; None leaves it to what the goal needs."""
    truth: npt.NDArray[np.float32] | None
    """Where the particles really were (N, D) [m]; None outside of the reversed family."""
    oracle: Method | None
    """The method that knows the reversed forces; None outside of the reversed family."""

    @property
    def bodies(self) -> int:
        """Number of bodies that the scene began with."""
        return len(self.simulator.scene.bodies)


def problem(case: Case) -> Problem:
    """Simulate a case up to its sketch.

    Raises
    ------
    SimulationError
        The simulation failed.
    """
    if case.family == "reversed":
        return _reversed(case)
    start = case.start()
    solver = MpmSolver(start.scene)
    solver.advance(start.frame)
    meant = start.sketch if start.meant is None else start.meant
    return Problem(case, solver, start.sketch, meant, None, None, None)


def uncontrolled(scenario: str, seed: int) -> Iterator[MpmSolver]:
    """Let a scene of a scenario alone, and yield its solver in eight frames, all the same object.

    These are the stages through which reversed cases are led and which they would come to by themselves:
    from a horizon before the frame at which control would start to a horizon after it.
    """
    start = _control_frame(seed)
    solver = MpmSolver(scenarios.get(scenario, seed))
    for frame in range(start - HORIZON + _APART, start + HORIZON + 1, _APART):
        solver.advance(frame - solver.frame)
        yield solver


def _reversed(case: Case) -> Problem:
    found = reversed_case(
        scenarios.get(case.scenario, case.seed),
        control_frame=_control_frame(case.seed),
        frames=HORIZON,
        start="live",
        kind=case.kind,
        cap=ORACLE_CAP,
        substeps="cfl",
    )
    sketch = found.sketch
    return Problem(case, found.simulator(), sketch, sketch, found.frames, found.target, Oracle(found))


def _control_frame(seed: int) -> int:
    """Draw the frame at which control starts in a reversed case."""
    return int(np.random.default_rng(seed).integers(HORIZON, 2 * HORIZON, endpoint=True))

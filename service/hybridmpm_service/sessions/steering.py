"""A sketch that steers a simulation, its progress and its result."""

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridmpm.control import Guidance
from hybridmpm.simulator import Simulator
from hybridmpm_service.sessions.view import Control, Phase


@dataclass(frozen=True)
class Steered:
    """A sketch that begins to steer."""

    number: int
    """Number of the sketch in its session."""
    first_frame: int
    """First frame of the session whose state it acts on."""
    guidance: Guidance
    """The interpreted sketch and its plan."""


class Steering:
    """A guidance that acts from a frame on, which may be later than the one that it was prepared for.

    The frames of the guidance are counted from that frame. Its law depends on the actual state, so it aims at
    the goal from the present positions, and no frame is lost.

    Parameters
    ----------
    number : int
        Number of the sketch in its session.
    guidance : Guidance
    simulator : Simulator
        Simulator to steer from its next frame on.
    control : Control, optional
        Progress so far; none if absent.
    """

    def __init__(
        self, number: int, guidance: Guidance, simulator: Simulator, control: Control | None = None
    ) -> None:
        self.guidance = guidance
        self._simulator = simulator
        self.control = control or Control(
            number=number,
            kind=guidance.sketch.kind,
            phase=self._phase_at(0),
            method=guidance.method,
            first_frame=simulator.frame,
            frames=guidance.frames,
            hold=guidance.hold,
        )
        """Progress of the sketch."""

    def on(self, simulator: Simulator) -> "Steering":
        """Return the same steering of a copy of the simulator."""
        twin = copy.copy(self)
        twin._simulator = simulator  # noqa: SLF001 - of this very class
        return twin

    def force(self) -> Any:
        """Return the force of the next frame, as `Simulator.advance` takes it."""
        return self.guidance.law.force(self._simulator, self.control.frames_done)

    def count(self) -> Control:
        """Note a computed frame, and return the progress."""
        done = self.control.frames_done + 1
        self.control = self.control.model_copy(update={"frames_done": done, "phase": self._phase_at(done)})
        if done == self.guidance.frames:
            self.control = self._with_reached(self.control)
        return self.control

    def _phase_at(self, done: int) -> Phase:
        guidance = self.guidance
        if done < guidance.frames:
            return "steering" if guidance.needs().reachable else "out_of_reach"
        return "holding" if done < guidance.total_frames else "done"

    def _with_reached(self, control: Control) -> Control:
        goal, x = self.guidance.goal, self._simulator.positions.astype(np.float64)
        weight = goal.cloud.weight
        if self._simulator.scene.is_open:
            # Only particles of the planned state are steered, and those that have left do not count.
            present = self._simulator.ids
            x = x[np.isin(present, goal.cloud.ids)]
            weight = weight[np.isin(goal.cloud.ids, present)]
            if not len(x):
                return control
        inside, drawn = goal.inside(x), goal.inside_drawn(x)
        return control.model_copy(
            update={
                "inside": None if inside is None else float(weight @ inside),
                "inside_drawn": None if drawn is None else float(weight @ drawn),
                "miss": float(np.linalg.norm(weight @ x / weight.sum() - goal.path[-1])),
            }
        )

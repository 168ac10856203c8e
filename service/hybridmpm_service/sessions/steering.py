"""A sketch that steers a simulation: who asked for it, how far it is, and what was reached."""

import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybridmpm.control import Guidance
from hybridmpm.simulator import Simulator
from hybridmpm_service.sessions.view import Control, Phase


@dataclass(frozen=True)
class Steered:
    """What is answered to a sketch that steers from now on."""

    number: int
    """Number of the sketch in its session."""
    first_frame: int
    """Frame of the session from which on it steers."""
    guidance: Guidance
    """The sketch as it was understood and planned."""


class Steering:
    """A guidance that acts from a frame on, which may be later than the one that it was prepared for.

    The frames of the guidance are counted from that frame. Its law looks at the actual state, so the goal is
    aimed at from wherever the particles have come to meanwhile, and no frame is lost.

    Parameters
    ----------
    number : int
        Number of the sketch in its session.
    guidance : Guidance
    simulator : Simulator
        It is steered from its next frame on.
    control : Control, optional
        How far it is already; at its beginning if absent.
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
        """How far it is."""

    def on(self, simulator: Simulator) -> "Steering":
        """Return the same steering, as far as it is, of a copy of the simulator."""
        twin = copy.copy(self)
        twin._simulator = simulator  # noqa: SLF001 - of this very class
        return twin

    def force(self) -> Any:
        """Return the force of the next frame, as `Simulator.advance` takes it."""
        return self.guidance.law.force(self._simulator, self.control.frames_done)

    def count(self) -> Control:
        """Note that a frame was computed, and return how far it is now."""
        done = self.control.frames_done + 1
        self.control = replace(self.control, frames_done=done, phase=self._phase_at(done))
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
            # What was there when the sketch was planned is led, and of that what is still there counts.
            present = self._simulator.ids
            x = x[np.isin(present, goal.cloud.ids)]
            weight = weight[np.isin(goal.cloud.ids, present)]
            if not len(x):
                return control
        inside, drawn = goal.inside(x), goal.inside_drawn(x)
        return replace(
            control,
            inside=None if inside is None else float(weight @ inside),
            inside_drawn=None if drawn is None else float(weight @ drawn),
            miss=float(np.linalg.norm(weight @ x / weight.sum() - goal.path[-1])),
        )

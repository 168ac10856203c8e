"""A sketch that steers a simulation: its progress, its force, and the law that a tab follows."""

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridmpm.control import Led, Sequence
from hybridmpm.playing import ways_file
from hybridmpm.simulator import Simulator
from hybridmpm_service.sessions.view import Control, Phase


@dataclass(frozen=True)
class Steered:
    """A sketch that begins to steer."""

    number: int
    """Number of the sketch in its session."""
    first_frame: int
    """First frame of the session whose state it acts on."""
    guidance: Led
    """The interpreted sketch and its plan."""


class Steering:
    """A guidance that acts from a frame on, which may be later than the one that it was prepared for.

    The frames of the guidance are counted from that frame. Its law depends on the actual state, so it aims at
    the goal from the present positions, and no frame is lost.

    Parameters
    ----------
    number : int
        Number of the sketch in its session.
    guidance : Guidance or Sequence
    simulator : Simulator
        Simulator to steer from its next frame on.
    control : Control, optional
        Progress so far; none if absent.
    """

    def __init__(
        self, number: int, guidance: Led, simulator: Simulator, control: Control | None = None
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
        twin.guidance = self.guidance.copied()
        return twin

    @property
    def ends_at(self) -> int:
        """Frame of the simulator after which nothing is steered."""
        return (self.control.first_frame or 0) + self.guidance.total_frames

    def ways(self) -> bytes:
        """Return the law of the next frames, up to the next goal of several, as a tab follows it.

        Raises
        ------
        ConfigError
            The force is not that of particles on ways.
        """
        guidance, started, ends_at = self.guidance, self.control.first_frame or 0, self.ends_at
        if isinstance(guidance, Sequence):
            index = self.control.frames_done
            ends_at = started + guidance.legs[guidance.number_at(index)].end
            since, guidance = guidance.leading(self._simulator, index)
            started += since
        return ways_file([(0, guidance)], started, ends_at - started)

    def force(self) -> Any:
        """Return the force of the next frame, as `Simulator.advance` takes it."""
        return self.guidance.law.force(self._simulator, self.control.frames_done)

    def count(self) -> Control:
        """Note a computed frame, and return the progress."""
        done, guidance = self.control.frames_done + 1, self.guidance
        update: dict[str, Any] = {"frames_done": done, "phase": self._phase_at(done)}
        arrivals = {guidance.frames}
        if isinstance(guidance, Sequence):
            arrivals = {leg.arrival for leg in guidance.legs}
            update |= {"keyframe": guidance.number, "kind": guidance.sketch.kind}
        self.control = self.control.model_copy(update=update)
        if done in arrivals:
            self.control = self._with_reached(self.control)
        return self.control

    def _phase_at(self, done: int) -> Phase:
        guidance = self.guidance
        if isinstance(guidance, Sequence) and done < guidance.frames:
            leg = guidance.legs[guidance.number_at(done)]
            if done >= leg.arrival:
                return "holding"
            return "steering" if leg.needs.reachable else "out_of_reach"
        if done < guidance.frames:
            return "steering" if guidance.needs().reachable else "out_of_reach"
        return "holding" if done < guidance.total_frames else "done"

    def _with_reached(self, control: Control) -> Control:
        goal, x = self.guidance.goal, self._simulator.positions.astype(np.float64)
        weight = goal.cloud.weight
        if self._simulator.scene.is_open or goal.cloud.partial:
            # Particles that are not led, and those that have left, do not count.
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

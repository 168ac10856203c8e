"""A run with a sketch: free motion, frames led by the sketch, and free motion again."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hybridmpm.cli.progress import progress
from hybridmpm.control import ControlledTrajectory, Following, Keyframe, Led, Sequence, Sketch, plan_motion
from hybridmpm.decisions import Decision, Mode, Span, spans
from hybridmpm.recording import Recording
from hybridmpm.recording.recording import check_size
from hybridmpm.recording.tracks import Tracks
from hybridmpm.simulator import Simulator

_LED = "led by the sketch"


@dataclass(frozen=True, eq=False)
class ControlRun:
    """Record of a run with a sketch."""

    guidance: Led
    """The interpreted sketch and its plan, or several in turn."""
    led: ControlledTrajectory
    """Motion of the particles in the frames that the sketch led."""
    recording: Recording
    """All frames from 0."""
    log: tuple[Decision, ...]
    """Switches between MPM and the network."""
    network: str
    """Name of the network in texts."""

    @property
    def first(self) -> int:
        """Frame at which the sketch was drawn."""
        return self.led.first_frame

    @property
    def last(self) -> int:
        """Last frame that the sketch led."""
        return self.led.first_frame + self.led.frames

    @property
    def is_reached(self) -> bool:
        """Whether the goal was reached, or each of several."""
        return all(reached.goal for reached in self.led.passed or (self.led.reached,))

    @property
    def sketches(self) -> tuple[Sketch, ...]:
        """The sketch, or those that are followed in turn."""
        if isinstance(self.guidance, Sequence):
            return tuple(keyframe.goal for keyframe in self.guidance.keyframes)
        return (self.guidance.sketch,)

    def number_at(self, frame: int) -> int:
        """Return the number of the sketch that leads at a frame, from 0 on."""
        if not isinstance(self.guidance, Sequence):
            return 0
        return self.guidance.number_at(max(0, frame - self.first - 1))

    @property
    def spans(self) -> list[Span]:
        """Frames by the simulator that computed them."""
        return spans(self.log, int(self.recording.frames[-1]))

    @property
    def simulated_by(self) -> list[Mode]:
        """Simulator of each frame, (F - 1,)."""
        return [span.mode for span in self.spans for _ in range(span.first, span.last + 1)]

    def name(self, mode: Mode) -> str:
        """Return the name of a simulator in texts."""
        return "MPM" if mode == "mpm" else self.network

    def summary(self) -> list[str]:
        """Return a line for each part of the run: its frames, their simulator and the reason."""
        lines = []
        for span in self.spans:
            edges = sorted({span.first - 1, span.last, *self._within(span)})
            for before, last in pairwise(edges):
                is_led = self.first <= before < self.last
                reason = _LED if is_led else self._reason(span, before)
                lines.append(f"frames {before + 1} to {last}: {self.name(span.mode)}, {reason}")
        return lines + [self._undone(*both) for both in self._tries_undone()]

    def _within(self, span: Span) -> set[int]:
        return {frame for frame in (self.first, self.last) if span.first <= frame < span.last}

    def _tries_undone(self) -> list[tuple[Decision, Decision]]:
        """Return pairs of decisions: to the network, and back to MPM from an earlier or the same frame."""
        return [
            (taken, back)
            for taken, back in pairwise(self.log)
            if taken.mode == "neural" and back.frame <= taken.frame
        ]

    def _reason(self, span: Span, before: int) -> str:
        if span.decision is None:
            return f"from whose states {self.network} begins"
        if before > span.decision.frame:
            return f"as since frame {span.decision.frame}"
        return _because(span.decision)

    def _undone(self, taken: Decision, back: Decision) -> str:
        tried = f"frame {taken.frame}: {self.network} was tried ({taken.reason})"
        return f"{tried}; undone: {_because(back)}"


def _because(decision: Decision) -> str:
    return decision.reason if decision.value is None else f"{decision.reason} {decision.value:.2f}"


def run_control(
    simulator: Simulator,
    sketch: Sketch | list[Keyframe],
    *,
    start: int,
    after: int,
    network: str,
    report: Callable[[str], object],
    settings: dict[str, Any],
) -> ControlRun:
    """Simulate from frame 0, follow a sketch, and simulate on.

    Parameters
    ----------
    simulator : Simulator
        At frame 0.
    sketch : Arrow or Ellipse
    start : int
        Number of frames before the sketch is drawn.
    after : int
        Number of frames after those of the sketch.
    network : str
        Name of the network in texts.
    report : callable
        Called with lines of text: what the sketch needs, before it is followed, and what was reached.
    settings : dict
        Arguments of `plan_motion`.
    """
    check_size(start + after + 1, simulator.particle_count, simulator.dim)
    tracks = Tracks(simulator, start + 1, "positions", "velocities")
    tracks.take(0)
    with progress(f"Simulating {start} frames", start) as bar:
        for _ in range(start):
            simulator.advance(1)
            tracks.take(simulator.frame)
            bar.update(1)
    guidance = plan_motion(simulator, sketch, **settings)
    following = Following(simulator, guidance)
    report(f"method {guidance.method}: {guidance.reason}")
    if isinstance(guidance, Sequence):
        for leg in guidance.legs:
            report(f"needs {leg.needs}")
    else:
        report(f"needs {guidance.needs()}")
    total = guidance.total_frames + after
    check_size(start + total + 1, len(tracks.ids), simulator.dim)
    tracks.lengthen(total)
    with progress(f"Following {guidance.total_frames} frames", guidance.total_frames) as bar:
        for _ in following:
            tracks.take(simulator.frame)
            bar.update(1)
    for reached in following.result.passed or (following.result.reached,):
        report(f"reached {reached}")
    with progress(f"Simulating {after} more frames", after) as bar:
        for _ in range(after):
            simulator.advance(1)
            tracks.take(simulator.frame)
            bar.update(1)
    recording = Recording(
        scene=simulator.scene,
        ids=tracks.ids,
        types=tracks.types,
        mass=tracks.mass,
        frames=np.arange(simulator.frame + 1),
        positions=tracks["positions"],
        velocities=tracks["velocities"],
        spacing=simulator.particle_spacing,
    )
    return ControlRun(guidance, following.result, recording, simulator.log, network)

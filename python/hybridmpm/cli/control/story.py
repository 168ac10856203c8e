"""A run with a sketch in it, from the first frame on: free, led by the sketch, free again."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hybridmpm.cli.progress import progress
from hybridmpm.control import ControlledTrajectory, Guidance, Sketch, follow
from hybridmpm.decisions import Decision, Mode, Span, spans
from hybridmpm.recording import Recording
from hybridmpm.recording.recording import check_size
from hybridmpm.recording.tracks import Tracks
from hybridmpm.simulator import Simulator

_LED = "led by the sketch"


@dataclass(frozen=True, eq=False)
class Story:
    """What came of a run."""

    guidance: Guidance
    """The sketch, and how it was to be followed."""
    led: ControlledTrajectory
    """The frames in which the sketch was followed, from the particles' point of view."""
    recording: Recording
    """All frames, from 0 on."""
    log: tuple[Decision, ...]
    """Decisions of the simulator about who simulates."""
    network: str
    """What the network is called."""

    @property
    def first(self) -> int:
        """Frame in which the sketch was drawn."""
        return self.led.first_frame

    @property
    def last(self) -> int:
        """Last frame that the sketch led."""
        return self.led.first_frame + self.led.frames

    @property
    def spans(self) -> list[Span]:
        """Who simulated which frames."""
        return spans(self.log, int(self.recording.frames[-1]))

    @property
    def simulated_by(self) -> list[Mode]:
        """Who simulated each frame, (F - 1,)."""
        return [span.mode for span in self.spans for _ in range(span.first, span.last + 1)]

    def name(self, mode: Mode) -> str:
        """Return what whoever simulates is called."""
        return "MPM" if mode == "mpm" else self.network

    def told(self) -> list[str]:
        """Return a line for each part of the run: which frames, who simulated them, and why."""
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
        """Return pairs of decisions: the network took over, and was found to err from there on."""
        return [
            (taken, back)
            for taken, back in pairwise(self.log)
            if taken.mode == "neural" and back.frame <= taken.frame
        ]

    def _reason(self, span: Span, before: int) -> str:
        if span.decision is None:
            return f"which {self.network} looks back on"
        if before > span.decision.frame:
            return f"still since frame {span.decision.frame}"
        return _because(span.decision)

    def _undone(self, taken: Decision, back: Decision) -> str:
        tried = f"frame {taken.frame}: {self.network} was tried ({taken.reason})"
        return f"{tried}; undone: {_because(back)}"


def _because(decision: Decision) -> str:
    return decision.reason if decision.value is None else f"{decision.reason} {decision.value:.2f}"


def run(
    simulator: Simulator,
    sketch: Sketch,
    *,
    start: int,
    after: int,
    network: str,
    tell: Callable[[str], object],
    settings: dict[str, Any],
) -> Story:
    """Simulate from frame 0 on, let a sketch lead, and go on.

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
        What the network is called.
    tell : callable
        Called with lines about what the sketch needs, before it is followed, and what it reached.
    settings : dict
        Arguments of `follow`.
    """
    check_size(start + after + 1, simulator.particle_count, simulator.dim)
    tracks = Tracks(simulator, start + 1, "positions", "velocities")
    tracks.take(0)
    with progress(f"Simulating {start} frames", start) as bar:
        for _ in range(start):
            simulator.advance(1)
            tracks.take(simulator.frame)
            bar.update(1)
    following = follow(simulator, sketch, **settings)
    guidance = following.guidance
    tell(f"method {guidance.method}: {guidance.reason}")
    tell(f"needs {guidance.needs()}")
    total = guidance.total_frames + after
    check_size(start + total + 1, len(tracks.ids), simulator.dim)
    tracks.lengthen(total)
    with progress(f"Following {guidance.total_frames} frames", guidance.total_frames) as bar:
        for _ in following:
            tracks.take(simulator.frame)
            bar.update(1)
    tell(f"reached {following.result.reached}")
    with progress(f"Going on for {after} frames", after) as bar:
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
    return Story(guidance, following.result, recording, simulator.log, network)

"""Decisions between a network and MPM: the log of a simulator, and what it says of each frame."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, Self

Mode = Literal["neural", "mpm"]
"""Simulator of a frame: a network, or the material point method."""

StepSource = Literal["network", "free_fall", "rest"]
"""Source of a network's step: the network itself, or free fall or rest where nothing else can happen."""


@dataclass(frozen=True)
class StepCounts:
    """Numbers of frames that MPM did not simulate, by the source of their steps."""

    network: int = 0
    """The network was evaluated."""
    free_fall: int = 0
    """All particles fell freely, and the network was not evaluated."""
    rest: int = 0
    """All particles were at rest, and the network was not evaluated."""

    def with_frame(self, source: StepSource) -> Self:
        """Return the numbers with one frame more."""
        return replace(self, **{source: getattr(self, source) + 1})


@dataclass(frozen=True, kw_only=True)
class Decision:
    """A decision: the simulator from a frame on."""

    frame: int
    """Number of the frame whose end is the first state that `mode` starts from."""
    mode: Mode
    value: float | None
    """Value of the guard that decided, or of the safeguard where no guard did; None where there is none
    yet."""
    reason: str
    """Name of the guard that decided; where no guard did, "warm-up", "calm", "free_fall", "rest", "force" or
    "unsound"."""
    noticed: int
    """Frame at which the decision was made. Later than `frame` where frames of the network were undone."""


def without_undone(log: Iterable[Decision]) -> list[Decision]:
    """Return the decisions without those that later ones undid; their frames increase strictly."""
    kept: list[Decision] = []
    for decision in log:
        while kept and kept[-1].frame >= decision.frame:
            kept.pop()
        if not kept or kept[-1].mode != decision.mode:
            kept.append(decision)
    return kept


@dataclass(frozen=True)
class Span:
    """Consecutive frames that one of the two simulated."""

    first: int
    """Number of the first frame, counted from 1."""
    last: int
    """Number of the last frame."""
    mode: Mode
    decision: Decision | None
    """The decision behind them; None for the frames before the first decision."""


def spans(log: Iterable[Decision], frames: int) -> list[Span]:
    """Return the spans of the first `frames` frames by simulator, without undone frames."""
    found = []
    since = 0
    mode: Mode = "mpm"
    latest: Decision | None = None
    for decision in without_undone(log):
        upto = min(decision.frame, frames)
        if upto > since:
            found.append(Span(since + 1, upto, mode, latest))
        since, mode, latest = upto, decision.mode, decision
    if frames > since:
        found.append(Span(since + 1, frames, mode, latest))
    return found


def frames_of_mpm(log: Iterable[Decision], frames: int) -> int:
    """Count the frames that MPM simulated among the first `frames`; a frame that was redone counts once."""
    return sum(span.last - span.first + 1 for span in spans(log, frames) if span.mode == "mpm")

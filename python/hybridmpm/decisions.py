"""Who simulates which frame, and why: the log of a simulator that may change hands."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, Self

Mode = Literal["neural", "mpm"]
"""Who simulates: a network, or the material point method."""

Answerer = Literal["network", "free_fall", "rest"]
"""Who answers a step of a network: itself, or free fall or rest where nothing else can happen."""


@dataclass(frozen=True)
class Answered:
    """Numbers of frames that MPM did not simulate, by who answered them."""

    network: int = 0
    """The network was evaluated."""
    free_fall: int = 0
    """All particles fell freely, and the network was not asked."""
    rest: int = 0
    """All particles were at rest, and the network was not asked."""

    def with_frame(self, by: Answerer) -> Self:
        """Return the numbers with one frame more."""
        return replace(self, **{by: getattr(self, by) + 1})


@dataclass(frozen=True, kw_only=True)
class Decision:
    """From one frame on, who simulates."""

    frame: int
    """Number of the frame whose end is the first state that `mode` goes on from."""
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
    """Leave out the decisions that later ones undid, so that the frames increase strictly."""
    kept: list[Decision] = []
    for decision in log:
        while kept and kept[-1].frame >= decision.frame:
            kept.pop()
        if not kept or kept[-1].mode != decision.mode:
            kept.append(decision)
    return kept


@dataclass(frozen=True)
class Span:
    """Frames in a row that one of the two simulated."""

    first: int
    """Number of the first frame, counted from 1."""
    last: int
    """Number of the last frame."""
    mode: Mode
    decision: Decision | None
    """Why; None for the frames before the first decision."""


def spans(log: Iterable[Decision], frames: int) -> list[Span]:
    """Return who simulated each of the first `frames` frames; what was undone is left out."""
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

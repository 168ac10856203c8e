"""Who simulates which frame, and why: the log of a simulator that may change hands."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Mode = Literal["neural", "mpm"]
"""Who simulates: a network, or the material point method."""


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
    """Name of the guard that decided; "warm-up", "calm", "force" or "unsound" where no guard did."""
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


def frames_of_mpm(log: Iterable[Decision], frames: int) -> int:
    """Count the frames that MPM simulated among the first `frames`; a frame that was redone counts once."""
    total, since, mode = 0, 0, "mpm"
    for decision in without_undone(log):
        upto = min(decision.frame, frames)
        total += (upto - since) * (mode == "mpm")
        since, mode = upto, decision.mode
    return total + (frames - since) * (mode == "mpm")

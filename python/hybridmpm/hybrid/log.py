"""Who simulated which frame, and why."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Mode = Literal["neural", "mpm"]


@dataclass(frozen=True, kw_only=True)
class Decision:
    """From which frame on who simulates."""

    frame: int
    """The state at the end of this frame is the first one that `mode` goes on from."""
    mode: Mode
    value: float | None
    """Of the guard that decided, or of the safeguard where none did; None where it is not known yet."""
    reason: str
    """The guard's name; "warm-up", "calm" or "force" where no guard decided."""
    noticed: int
    """Frame at which it was decided. Later than `frame` where frames of the network were undone."""


def standing(log: Iterable[Decision]) -> list[Decision]:
    """Leave out the decisions that later ones undid, so that frames increase strictly."""
    kept: list[Decision] = []
    for decision in log:
        while kept and kept[-1].frame >= decision.frame:
            kept.pop()
        if not kept or kept[-1].mode != decision.mode:
            kept.append(decision)
    return kept


def frames_of_mpm(log: Iterable[Decision], frames: int) -> int:
    """Count the frames of the first `frames` that MPM simulated, those redone once."""
    total, since, mode = 0, 0, "mpm"
    for decision in standing(log):
        upto = min(decision.frame, frames)
        total += (upto - since) * (mode == "mpm")
        since, mode = upto, decision.mode
    return total + (frames - since) * (mode == "mpm")

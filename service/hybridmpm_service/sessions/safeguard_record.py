"""What a hybrid session's safeguard measured, and who simulated when, for those who watch."""

import math
from collections import deque
from dataclasses import dataclass

from hybridmpm.decisions import Decision, Mode, without_undone
from hybridmpm.simulator import Simulator
from hybridmpm_service.sessions.solvers import SafeguardKind, Watch

HISTORY_FRAMES = 1000
"""Frames for which values are kept: the length of most scenarios."""
DIGITS = 4
"""Decimals of a value that is told; the safeguard's own noise is larger."""


@dataclass(frozen=True, kw_only=True)
class Safeguard:
    """Of a hybrid session, at one instant."""

    kind: SafeguardKind
    r_c: float
    value: float | None
    mpm_share: float
    frames: tuple[int, ...]
    """At which the values were taken."""
    values: tuple[float, ...]
    decisions: tuple[Decision, ...]
    """All since frame 0."""

    def phases(self, frame: int) -> list[tuple[int, Mode]]:
        """Return from which frame on who simulated, for the last `HISTORY_FRAMES` before `frame`."""
        all_phases: list[tuple[int, Mode]] = [(0, "mpm")]
        all_phases += [(decision.frame, decision.mode) for decision in without_undone(self.decisions)]
        first = max(0, frame - HISTORY_FRAMES)
        ends = [start for start, _ in all_phases[1:]] + [frame + 1]
        return [phase for phase, end in zip(all_phases, ends, strict=True) if end > first]


class SafeguardRecorder:
    """Keeps the latest values of a simulator's safeguard."""

    def __init__(self, simulator: Simulator, watch: Watch) -> None:
        self._simulator, self._watch = simulator, watch
        self._r_t = simulator.r_t
        self._values: deque[tuple[int, float]] = deque(maxlen=max(2, HISTORY_FRAMES // self._r_t))

    def note(self) -> None:
        """Take the value of the present frame, where it is a new one."""
        value, frame = finite(self._simulator.safeguard), self._simulator.frame
        if value is not None and frame % self._r_t == 0:
            self._values.append((frame, value))

    def clear(self) -> None:
        """Forget all values."""
        self._values.clear()

    def look(self) -> Safeguard:
        """Return what there is."""
        return Safeguard(
            kind=self._watch.kind,
            r_c=self._watch.r_c,
            value=finite(self._simulator.safeguard),
            mpm_share=self._simulator.mpm_share,
            frames=tuple(frame for frame, _ in self._values),
            values=tuple(value for _, value in self._values),
            decisions=self._simulator.log,
        )


def finite(value: float | None) -> float | None:
    """Return a number as it may be told in JSON; None where it is not finite."""
    return None if value is None or not math.isfinite(value) else round(value, DIGITS)

"""Record of a hybrid session: what its safeguard measured, and who simulated which frames."""

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hybridmpm.decisions import Decision, Mode, without_undone
from hybridmpm.simulator import Simulator
from hybridmpm_service.sessions.solvers import SafeguardKind, SafeguardSettings

HISTORY_FRAMES = 1000
"""Number of frames for which values are kept: the length of most scenarios."""
DIGITS = 4
"""Number of decimals in which values are answered; the safeguard's own noise is larger."""


@dataclass(frozen=True, kw_only=True)
class Safeguard:
    """Safeguard of a hybrid session, and its record, at one instant."""

    kind: SafeguardKind
    """Mean of the cosines that the safeguard takes."""
    r_c: float | None
    """Value below which the safeguard alarms; None where other guards alone do."""
    value: float | None
    """Mean cosine in [-1, 1] at present; None until both windows of time are full."""
    mpm_share: float
    """Share of the frames so far that MPM simulated, in [0, 1]."""
    frames: tuple[int, ...]
    """Frames at which `values` were taken, ascending."""
    values: tuple[float, ...]
    """Mean cosines over the last `HISTORY_FRAMES` frames."""
    decisions: tuple[Decision, ...]
    """All decisions since frame 0 about who simulates."""

    def phases(self, frame: int) -> list[tuple[int, Mode]]:
        """Return the phases of the last `HISTORY_FRAMES` before `frame`: first frame, and who simulated."""
        all_phases: list[tuple[int, Mode]] = [(0, "mpm")]
        all_phases += [(decision.frame, decision.mode) for decision in without_undone(self.decisions)]
        first = max(0, frame - HISTORY_FRAMES)
        ends = [start for start, _ in all_phases[1:]] + [frame + 1]
        return [phase for phase, end in zip(all_phases, ends, strict=True) if end > first]


class SafeguardRecorder:
    """Keeps the latest values of a simulator's safeguard."""

    def __init__(self, simulator: Simulator, settings: SafeguardSettings) -> None:
        self._simulator, self._settings = simulator, settings
        self._r_t = simulator.r_t
        self._values: deque[tuple[int, float]] = deque(maxlen=max(2, HISTORY_FRAMES // self._r_t))

    def on(self, simulator: Simulator) -> "SafeguardRecorder":
        """Return a recorder of a copy of the simulator, with the values so far."""
        twin = SafeguardRecorder(simulator, self._settings)
        twin._values.extend(self._values)
        return twin

    def note(self) -> None:
        """Keep the present value, in one frame of each step of the network: it changes no faster."""
        value, frame = finite(self._simulator.safeguard), self._simulator.frame
        if value is not None and frame % self._r_t == 0:
            self._values.append((frame, value))

    @property
    def values(self) -> list[tuple[int, float]]:
        """Frames and the values in them, as plain data."""
        return list(self._values)

    def recall(self, values: Iterable[Sequence[float]]) -> None:
        """Have these values, from `values`."""
        self._values.clear()
        self._values.extend((int(frame), value) for frame, value in values)

    def clear(self) -> None:
        """Forget all values."""
        self._values.clear()

    def look(self) -> Safeguard:
        """Return the safeguard and its record as they are now."""
        return Safeguard(
            kind=self._settings.kind,
            r_c=self._settings.r_c,
            value=finite(self._simulator.safeguard),
            mpm_share=self._simulator.mpm_share,
            frames=tuple(frame for frame, _ in self._values),
            values=tuple(value for _, value in self._values),
            decisions=self._simulator.log,
        )


def finite(value: float | None) -> float | None:
    """Return a number as JSON can carry it, rounded to `DIGITS`; None where it is not finite."""
    return None if value is None or not math.isfinite(value) else round(value, DIGITS)

"""When to change rung: a decision from the times of the latest frames, with neither clock nor simulator."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

WINDOW = 20
"""Frames that a decision looks back on: five carries."""
_LEVEL = 2
"""The time that has to keep within the budget is the second longest of the window: one frame in twenty may
leave it, and one that the machine was busy in says nothing."""
_ROOM = 0.8
"""Part of the budget that a more accurate rung is expected to keep within before it is tried."""
_LONGEST_WAIT = 4096


@dataclass
class Controller:
    """Chooses among rungs by the times that frames take.

    Parameters
    ----------
    expected : sequence of float
        Expected times of the rungs [ms], ascending.
    budget : float
        Time that a frame may take [ms].
    rung : int
        Index of the present rung.
    """

    expected: Sequence[float]
    budget: float
    rung: int
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _frames: int = 0
    _wait: int = 2 * WINDOW
    _climbed: bool = False

    @property
    def level(self) -> float | None:
        """What frames take [ms]: the second longest of the window; None until it is full."""
        return sorted(self._times)[-_LEVEL] if len(self._times) == WINDOW else None

    def enter(self, milliseconds: float) -> int:
        """Enter the time of a frame, and return the rung for the next ones.

        Above the budget it is the most accurate of the cheaper rungs that is expected to keep within, and the
        cheapest where none is. Otherwise it is the next more accurate one, if there is room for it; after one
        that did not keep within, only after twice as many frames as before.
        """
        self._times.append(milliseconds)
        self._frames += 1
        level = self.level
        if level is None:
            return self.rung
        factor = level / self.expected[self.rung]
        if level > self.budget and self.rung > 0:
            within = [i for i in range(self.rung) if factor * self.expected[i] <= self.budget]
            if self._climbed:
                self._wait = min(2 * self._wait, _LONGEST_WAIT)
            self._change(max(within, default=0), climbed=False)
        elif (
            self.rung + 1 < len(self.expected)
            and self._frames >= self._wait
            and factor * self.expected[self.rung + 1] <= _ROOM * self.budget
        ):
            self._change(self.rung + 1, climbed=True)
        return self.rung

    def _change(self, rung: int, *, climbed: bool) -> None:
        self.rung, self._climbed, self._frames = rung, climbed, 0
        self._times.clear()

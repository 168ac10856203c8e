"""When to change level: a decision from the times of the latest frames, with neither clock nor simulator."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

WINDOW = 20
"""Frames that a decision looks back on: five carries."""
_LEVEL = 2
"""The time that has to keep within the budget is the second longest of the window: one frame in twenty may
leave it, and one that the machine was busy in says nothing."""
_ROOM = 0.8
"""Part of the budget that a more accurate coarse level is expected to keep within before it is tried."""
_LONGEST_WAIT = 4096


@dataclass
class Controller:
    """Chooses among coarse levels by the times that frames take.

    Parameters
    ----------
    expected : sequence of float
        Expected times of the coarse levels [ms], ascending.
    budget : float
        Time that a frame may take [ms].
    index : int
        Index of the present coarse level.
    """

    expected: Sequence[float]
    budget: float
    index: int
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _frames: int = 0
    _wait: int = 2 * WINDOW
    _climbed: bool = False

    @property
    def time(self) -> float | None:
        """What frames take [ms]: the second longest of the window; None until it is full."""
        return sorted(self._times)[-_LEVEL] if len(self._times) == WINDOW else None

    def enter(self, milliseconds: float) -> int:
        """Enter the time of a frame, and return the coarse level for the next ones.

        Above the budget it is the most accurate of the cheaper coarse levels that is expected to keep within, and the
        cheapest where none is. Otherwise it is the next more accurate one, if there is room for it; after one
        that did not keep within, only after twice as many frames as before.
        """
        self._times.append(milliseconds)
        self._frames += 1
        time = self.time
        if time is None:
            return self.index
        factor = time / self.expected[self.index]
        if time > self.budget and self.index > 0:
            within = [i for i in range(self.index) if factor * self.expected[i] <= self.budget]
            if self._climbed:
                self._wait = min(2 * self._wait, _LONGEST_WAIT)
            self._change(max(within, default=0), climbed=False)
        elif (
            self.index + 1 < len(self.expected)
            and self._frames >= self._wait
            and factor * self.expected[self.index + 1] <= _ROOM * self.budget
        ):
            self._change(self.index + 1, climbed=True)
        return self.index

    def _change(self, index: int, *, climbed: bool) -> None:
        self.index, self._climbed, self._frames = index, climbed, 0
        self._times.clear()

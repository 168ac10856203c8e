"""How many frames a player owes: simulated time against the clock on the wall."""

from collections.abc import Callable
from dataclasses import dataclass

Clock = Callable[[], float]
"""Returns the seconds since an arbitrary start; they never go back."""

MAX_LAG_SECONDS = 0.1
"""Longest time that a player makes up for. It forgets the rest, since catching up later looks like a jump."""


@dataclass
class Pace:
    """Turns seconds on a clock into frames, `speed / frame_dt` of them per second.

    Parameters
    ----------
    frame_dt : float > 0
        Simulated seconds of a frame.
    speed : float > 0
        Simulated seconds per second.
    """

    frame_dt: float
    speed: float
    _origin: float = 0.0
    _done: int = 0

    def start(self, now: float) -> None:
        """Owe frames from now on, and none from before."""
        self._origin, self._done = now, 0

    def set_speed(self, speed: float, now: float) -> None:
        """Go on at another speed, without a jump."""
        self.speed = speed
        self.start(now)

    def due(self, now: float) -> int:
        """Return how many frames are owed now."""
        owed = self._owed(now)
        most = max(1.0, MAX_LAG_SECONDS * self._rate)
        if owed > most:
            self.start(now)
            self._origin -= most / self._rate
            owed = most
        return int(owed)

    def count(self, frames: int) -> None:
        """Note that so many frames have been computed."""
        self._done += frames

    def wait(self, now: float) -> float:
        """Return the seconds until the next frame is due."""
        return max(0.0, (1.0 - self._owed(now)) / self._rate)

    @property
    def _rate(self) -> float:
        return self.speed / self.frame_dt

    def _owed(self, now: float) -> float:
        # The small excess keeps a frame that is due exactly now from slipping to the next look.
        return (now - self._origin) * self._rate - self._done + 1e-9

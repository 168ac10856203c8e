"""Paths of particles within a step of a network."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True)
class StepPath:
    """Path of particles within a network step, from 0 to 1.

    It is a parabola with the curvature of the known acceleration, on each axis as far as the second
    difference of the network's own states confirms it. So free fall is exact and resting particles stay. An
    impact, at an unknown instant, gives a straight line: a full parabola would throw particles back from the
    floor.
    """

    start: _Floats
    """Position at `begin` (N, D) [m]."""
    end: _Floats
    """Position at 1 (N, D) [m]."""
    bend: _Floats
    """Second derivative (N, D) [m per step^2]."""
    begin: float = 0.0

    @classmethod
    def between(cls, before: _Floats, now: _Floats, after: _Floats, known: _Floats) -> Self:
        """Join two states (N, D) [m] of a network, given the one before and the known acceleration.

        Parameters
        ----------
        before, now, after : (N, D)
            Successive states [m].
        known : (N, D)
            Acceleration [m per step^2].
        """
        found = after - 2 * now + before
        # The smaller of the two where they agree in sign, else 0.
        bend = np.clip(found, np.minimum(known, 0), np.maximum(known, 0))
        return cls(now, after, bend)

    def at(self, moment: float) -> _Floats:
        """Positions (N, D) [m] at a moment in [begin, 1]."""
        if moment >= 1.0:
            return self.end
        past, left = np.float32(moment - self.begin), np.float32(1.0 - moment)
        way = (self.end - self.start) * (past / (past + left))
        return np.asarray(self.start + way - self.bend * (past * left / 2))

    def velocity(self, moment: float) -> _Floats:
        """Velocities (N, D) [m per step] at a moment in [begin, 1]."""
        length = np.float32(1.0 - self.begin)
        off_middle = np.float32(moment - (1.0 + self.begin) / 2)
        return np.asarray((self.end - self.start) / length + self.bend * off_middle)

    def pushed(self, moment: float, change: _Floats, lower: _Floats, upper: _Floats) -> Self:
        """Go on from a moment with another known acceleration, within walls.

        Parameters
        ----------
        moment : float in [begin, 1)
        change : (N, D)
            Of the acceleration [m per step^2]. The end moves by it times what is left of the step: the
            network's own step, x + v + a, with the mean acceleration in it.
        lower, upper : (D,)
            Corners [m].
        """
        end = np.clip(self.end + change * np.float32(1.0 - moment), lower, upper)
        return replace(self, start=self.at(moment), end=end, begin=moment)

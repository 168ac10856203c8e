"""What the frame loop keeps in mind."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.hybrid.guard import Guard
from hybridmpm.physics.track import StepPath

_Floats = npt.NDArray[np.float32]
_MAX_DOUBLINGS = 6


@dataclass(frozen=True)
class Step:
    """A step of the network under way, from one state to the next, `r_t` frames later."""

    x: StepPath
    v: tuple[_Floats, _Floats]
    """At its two ends."""


@dataclass(frozen=True)
class Checkpoint:
    """A state to go back to."""

    frame: int
    steps: int
    """Of the network, since it took over."""
    mpm: bytes
    path: tuple[_Floats, ...]
    history: _native.AccelerationHistory
    guards: tuple[Guard, ...]
    value: float | None


class Patience:
    """For how many steps the motion has to be calm before the network takes over.

    None at the beginning, then a window of them, twice as many after each failure in a row.
    """

    def __init__(self, window: int) -> None:
        self._window = window
        self._calm = self._needed = self._failures = 0

    @property
    def is_over(self) -> bool:
        """Whether the network may take over."""
        return self._calm >= self._needed

    def see(self, *, is_calm: bool) -> None:
        """Count a step."""
        self._calm = self._calm + 1 if is_calm else 0

    def renew(self, *, steps: int | None = None, is_fault: bool = False) -> None:
        """Begin anew, because MPM takes over.

        Parameters
        ----------
        steps : int, optional
            That the network made. One that does not last for a window counts as one that erred, whoever
            noticed; after four windows its failures are forgiven.
        is_fault : bool
            Whether the network erred.
        """
        if is_fault or (steps is not None and steps < self._window):
            self._failures = min(self._failures + 1, _MAX_DOUBLINGS)
        elif steps is not None and steps >= 4 * self._window:
            self._failures = 0
        self._calm, self._needed = 0, self._window * 2**self._failures

"""`Guard`: the interface of measures of a network's motion, and their input."""

import copy
import enum
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.errors import SnapshotError
from hybridmpm.mpm import MpmSolver


class Stage(enum.Enum):
    """Stage of a network's step at which a guard is evaluated, once a step."""

    RAW = 1
    """The network's output as it is."""
    MOTION = 2
    """The motion that the output would make."""
    STATE = 3
    """The state at the end of the step."""


@dataclass(frozen=True, kw_only=True)
class GuardInput:
    """Input of guards."""

    x: npt.NDArray[np.float32]
    """Positions (N, D) [m] at the end of the step; before `STATE` the network's output."""
    mpm: MpmSolver
    """The state before the step, after it for `STATE`; not to be changed."""
    r_t: int
    """Frames of a step."""
    steps: int
    """Steps of the network since it took over; 0 while MPM simulates."""
    signal: _core.AccelerationSignal | None = None
    """Cosines and accelerations of the step; None at `RAW`."""
    report: _core.MotionReport | None = None
    """Measurements of MPM when it took over the positions; None before `STATE`."""
    mpm_step: Callable[[], npt.NDArray[np.float32] | None] = lambda: None
    """Returns the positions (N, D) [m] that MPM reaches in the same step from the same state; None where
    MPM fails. Computed at most once a step, and only at `MOTION`."""


@dataclass(eq=False)
class Guard(ABC):
    """One measure of the network's motion, and its alarming values.

    A guard is a dataclass. The fields of its constructor are its settings. Fields with `init=False` are its
    state, as numbers or tuples of them; snapshots contain them.
    """

    name: ClassVar[str]
    stage: ClassVar[Stage]
    is_fault: ClassVar[bool] = True
    """Whether an alarm is a failure of the network; else only the motion has become complex."""
    undo: ClassVar[int] = 0
    """Number of steps, before the alarming one, that are undone with it, because an alarm may come late."""

    def begin(self, start: _core.MotionReport) -> None:  # noqa: B027 - most guards have no state
        """Start anew from the state in which the network takes over."""

    @abstractmethod
    def value(self, given: GuardInput) -> float | None:
        """Return the measure; None where it is not defined yet."""

    @abstractmethod
    def alarms(self, value: float) -> bool:
        """Whether MPM has to take over."""

    def is_quiet(self, value: float) -> bool:
        """Whether the network may take over by this measure."""
        return not self.alarms(value)

    def copy(self) -> Self:
        """Return an independent guard in the same state."""
        return copy.copy(self)

    def settings(self) -> dict[str, Any]:
        """Return the arguments that the constructor makes an equal guard from."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.init}

    def to_dict(self) -> dict[str, Any]:
        """Return the guard's state as plain data, for a snapshot.

        Raises
        ------
        SnapshotError
            An attribute is no field of the guard's dataclass, or a field is not a number, string, None or a
            tuple of these.
        """
        unknown = sorted(set(vars(self)) - {field.name for field in fields(self)})
        if unknown:
            raise SnapshotError(
                f"the guard {self.name!r} keeps {', '.join(unknown)}, which a snapshot would lose: make its "
                "class a dataclass and declare them as fields with init=False"
            )
        state = {field.name: getattr(self, field.name) for field in fields(self) if not field.init}
        for name, value in state.items():
            parts = value if isinstance(value, tuple) else (value,)
            if not all(isinstance(part, int | float | str | np.generic | None) for part in parts):
                raise SnapshotError(
                    f"the guard {self.name!r} keeps {name} as {type(value).__name__}: a guard's state may "
                    "hold only numbers, strings, None, and tuples of these"
                )
        return state

    def from_dict(self, state: dict[str, Any]) -> Self:
        """Return a guard with these settings and the state that `to_dict` returned.

        Raises
        ------
        SnapshotError
            The state is that of another kind of guard.
        """
        if {field.name for field in fields(self) if not field.init} != set(state):
            raise SnapshotError("the snapshot was made with other guards")
        twin = self.copy()
        for name, value in state.items():
            setattr(twin, name, tuple(value) if isinstance(value, list) else value)
        return twin

"""`Guard`: the interface of what watches a network, and what it gets to see."""

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
    """When a guard is asked, once a step of the network."""

    RAW = 1
    """About the network's answer as it is."""
    MOTION = 2
    """About the motion that the answer would make."""
    STATE = 3
    """About the state that the step has made."""


@dataclass(frozen=True, kw_only=True)
class View:
    """What guards look at; each takes what it needs."""

    x: npt.NDArray[np.float32]
    """Positions (N, D) [m] at the end of the step; before `STATE` as the network answered."""
    mpm: MpmSolver
    """The state before the step, after it for `STATE`; not to be changed."""
    r_t: int
    """Frames of a step."""
    steps: int
    """Steps of the network since it took over; 0 while MPM simulates."""
    signal: _core.AccelerationSignal | None = None
    """Cosines and accelerations of the step; None at `RAW`."""
    report: _core.MotionReport | None = None
    """What MPM measured when it took over the positions; None before `STATE`."""
    own: Callable[[], npt.NDArray[np.float32] | None] = lambda: None
    """Simulates the step by MPM, from the same state, and returns where that leads (N, D) [m]; None where
    MPM fails. Computed once however often it is called, and only at `MOTION`."""


@dataclass(eq=False)
class Guard(ABC):
    """One measure of the network's motion, and the values of it that are alarming.

    A guard is a dataclass. The fields of its constructor are its settings; fields with `init=False` are what
    it remembers from step to step, as numbers or tuples of them, and they are kept in snapshots.
    """

    name: ClassVar[str]
    stage: ClassVar[Stage]
    is_fault: ClassVar[bool] = True
    """Whether an alarm says that the network erred; else it only says that the motion has become complex."""
    undo: ClassVar[int] = 0
    """Steps before the alarming one that are undone with it, because an alarm may come late."""

    def begin(self, start: _core.MotionReport) -> None:  # noqa: B027 - most guards remember nothing
        """Take note of the state from which the network takes over."""

    @abstractmethod
    def value(self, view: View) -> float | None:
        """Measure; None where there is nothing to say yet."""

    @abstractmethod
    def alarms(self, value: float) -> bool:
        """Whether MPM has to take over."""

    def is_quiet(self, value: float) -> bool:
        """Whether the network may take over, for what this guard knows."""
        return not self.alarms(value)

    def copy(self) -> Self:
        """Return an independent guard in the same state."""
        return copy.copy(self)

    def settings(self) -> dict[str, Any]:
        """Return the arguments that the constructor makes an equal guard from."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.init}

    def remember(self) -> dict[str, Any]:
        """Return what the guard remembers, for a snapshot.

        Raises
        ------
        SnapshotError
            The guard keeps something in an attribute that is no field of its dataclass, or keeps anything but
            numbers, texts, None and tuples of them.
        """
        known = {field.name for field in fields(self)}
        unknown = sorted(set(vars(self)) - known)
        if unknown:
            raise SnapshotError(
                f"the guard {self.name!r} keeps {', '.join(unknown)}, which a snapshot would lose: make its "
                "class a dataclass and declare them as fields with init=False"
            )
        memory = {field.name: getattr(self, field.name) for field in fields(self) if not field.init}
        for name, value in memory.items():
            parts = value if isinstance(value, tuple) else (value,)
            if not all(isinstance(part, int | float | str | np.generic | None) for part in parts):
                raise SnapshotError(
                    f"the guard {self.name!r} keeps {name} as {type(value).__name__}: a snapshot holds "
                    "numbers, texts, None and tuples of them"
                )
        return memory

    def recall(self, memory: dict[str, Any]) -> None:
        """Take what `remember` returned.

        Raises
        ------
        SnapshotError
            It was another kind of guard that remembered it.
        """
        known = {field.name for field in fields(self) if not field.init}
        if known != set(memory):
            raise SnapshotError("the snapshot was made with other guards")
        for name, value in memory.items():
            setattr(self, name, tuple(value) if isinstance(value, list) else value)

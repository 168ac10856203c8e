"""What changes while a hybrid simulation runs: one record that copies, checkpoints and snapshots share."""

import copy
import dataclasses
from dataclasses import dataclass, field
from typing import Any, Self, get_args

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.coarse import Upsampler
from hybridmpm.coarse.upsampler import Few
from hybridmpm.coarse.upsampler import recalled as recalled_upsampler
from hybridmpm.decisions import Answered, Answerer, Decision, Mode
from hybridmpm.errors import SnapshotError
from hybridmpm.hybrid.guard import Guard
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.track import Track

_Floats = npt.NDArray[np.float32]
_NEAR = 8
"""Latest steps of the network whose beginnings are all kept, to go back to."""
_APART, _FAR = 10, 4
"""Steps from one older state to the next that is kept, and their number."""
_MAX_DOUBLINGS = 2
"""Doublings of the wait of a network that fails again and again."""


@dataclass
class Backoff:
    """How many steps MPM simulates before the network may take over.

    None at the beginning, then `wait`. The number is doubled each time that the network errs before it has
    made as many steps as it had waited for, and halved where it made more.
    """

    wait: int
    calm: int = 0
    """Steps of MPM in a row so far that no guard objected to."""
    needed: int = 0
    """Such steps in a row that the network has to wait for."""
    doublings: int = 0
    """How often the wait is doubled at present, at most twice."""

    @property
    def is_over(self) -> bool:
        """Whether the network may take over."""
        return self.calm >= self.needed

    def count(self, *, is_calm: bool) -> None:
        """Count a step of MPM."""
        self.calm = self.calm + 1 if is_calm else 0

    def restart(self, *, steps: int = 0, is_fault: bool = False) -> None:
        """Wait anew, because MPM takes over.

        Parameters
        ----------
        steps : int
            Number of steps that the network made.
        is_fault : bool
            Whether the network erred.
        """
        if steps > max(self.needed, self.wait):
            self.doublings = max(self.doublings - 1, 0)
        elif is_fault:
            self.doublings = min(self.doublings + 1, _MAX_DOUBLINGS)
        self.calm, self.needed = 0, self.wait * 2**self.doublings


@dataclass
class Moment:
    """State of network, history and guards at one instant; a rollback takes it back together with MPM's."""

    track: Track
    """The states that the network looks back on, and its step under way."""
    history: _core.AccelerationHistory
    """Accelerations of the last two windows of time."""
    guards: tuple[Guard, ...]
    frame: int = 0
    """Number of frames since the start."""
    steps: int = 0
    """Number of steps since MPM simulated last."""
    asked: int = 0
    """How many of these, to the latest, the network itself answered in a row."""
    value: float | None = None
    """Value of the safeguard."""
    velocities: tuple[_Floats, _Floats] | None = None
    """Velocities (N, D) [m/s] at the two ends of the network's step under way."""
    answered_by: Answerer = "network"
    """Who answered the network's step under way, or the latest one."""
    answered: Answered = field(default_factory=Answered)
    """Frames that MPM did not simulate, by who answered them."""

    def tick(self) -> None:
        """Count a frame of the network's step."""
        self.frame += 1
        self.answered = self.answered.with_frame(self.answered_by)

    def copy(self) -> "Moment":
        """Return an independent moment with the same network."""
        return dataclasses.replace(
            self,
            track=self.track.copy(),
            history=self.history.copy(),
            guards=tuple(guard.copy() for guard in self.guards),
        )

    def remember(self) -> dict[str, Any]:
        """Return the moment as a tree for a snapshot."""
        return {
            "track": self.track.remember(),
            "history": self.history.snapshot(),
            "guards": [{"name": guard.name, "memory": guard.remember()} for guard in self.guards],
            "frame": self.frame,
            "steps": self.steps,
            "asked": self.asked,
            "value": self.value,
            "velocities": None if self.velocities is None else list(self.velocities),
            "answered_by": self.answered_by,
            "answered": dataclasses.asdict(self.answered),
        }

    def recalled(self, memory: dict[str, Any]) -> "Moment":
        """Return the moment that `remember` returned, with the network and the guards of this one."""
        twin = self.copy()
        names = [kept["name"] for kept in memory["guards"]]
        if names != [guard.name for guard in self.guards]:
            raise SnapshotError(f"the snapshot was made with other guards: {', '.join(names) or 'none'}")
        twin.track.recall(memory["track"])
        twin.history.restore(memory["history"])
        for guard, kept in zip(twin.guards, memory["guards"], strict=True):
            guard.recall(kept["memory"])
        ends = memory["velocities"]
        return dataclasses.replace(
            twin,
            frame=memory["frame"],
            steps=memory["steps"],
            asked=memory["asked"],
            value=memory["value"],
            velocities=None if ends is None else (ends[0], ends[1]),
            answered_by=memory["answered_by"],
            answered=Answered(**memory["answered"]),
        )


@dataclass(frozen=True)
class Checkpoint:
    """A state to go back to."""

    moment: Moment
    mpm: bytes
    """Snapshot of MPM."""
    carried: bytes | None
    """Snapshot of the upsampler; None without one."""

    def remember(self) -> dict[str, Any]:
        """Return the state as a tree for a snapshot."""
        return {"moment": self.moment.remember(), "mpm": self.mpm, "coarse": self.carried}


@dataclass
class HybridState:
    """All that changes while a hybrid simulation runs."""

    mpm: MpmSolver
    """MPM at the present state, or during a step of the network at the step's beginning."""
    moment: Moment
    backoff: Backoff
    upsampler: Upsampler | None
    """Who carries all particles of the scene along; None where those simulated are shown."""
    mode: Mode = "mpm"
    """Who simulates the next frame."""
    log: list[Decision] = field(default_factory=list)
    checkpoints: list[Checkpoint] = field(default_factory=list)
    """States to go back to, the oldest first: the beginnings of the network's latest steps, and a few of
    those before."""
    entries: list[Checkpoint] = field(default_factory=list)
    """States in which MPM handed over to the network lately, before the latest time, the oldest first."""

    def copy(self, few: Few | None = None) -> "HybridState":
        """Return an independent state with the same network, for a copy of the few or for the same few."""
        return dataclasses.replace(
            self,
            mpm=self.mpm.copy(),
            moment=self.moment.copy(),
            backoff=copy.copy(self.backoff),
            upsampler=None if self.upsampler is None else self.upsampler.copy(few),
            log=list(self.log),
            checkpoints=list(self.checkpoints),
            entries=list(self.entries),
        )

    def checkpoint(self) -> Checkpoint:
        """Return the present state, to go back to."""
        return Checkpoint(self.moment.copy(), self.mpm.snapshot(), self._carried())

    def keep(self) -> None:
        """Keep the present state, to go back to, and of the older ones fewer and fewer."""
        steps = self.moment.steps
        older = [kept for kept in self.checkpoints if kept.moment.steps <= steps - _NEAR]
        near = self.checkpoints[len(older) :]
        apart = [kept for kept in older if kept.moment.steps % _APART == 0]
        self.checkpoints = [*apart[-_FAR:], *near, self.checkpoint()]

    def begin_with_present(self, since: int) -> None:
        """Keep the present state, in which the network takes over, and such ones since a frame."""
        older = [*self.entries, *self.checkpoints[:1]]
        self.entries = [kept for kept in older if kept.moment.frame >= since][-_FAR:]
        self.checkpoints = [self.checkpoint()]

    def forget(self) -> None:
        """Forget all states to go back to."""
        self.checkpoints, self.entries = [], []

    @property
    def can_go_back(self) -> bool:
        """Whether there is a state to go back to."""
        return bool(self.checkpoints or self.entries)

    def go_back(self) -> None:
        """Go back to the latest state that is kept, and keep it no longer."""
        self.take_back((self.checkpoints or self.entries).pop())

    def take_back(self, checkpoint: Checkpoint) -> None:
        """Go back to a state. Log, backoff and other checkpoints stay."""
        self.mpm.restore(checkpoint.mpm)
        self.moment = checkpoint.moment.copy()
        self.upsampler = recalled_upsampler(self.upsampler, checkpoint.carried)

    def _carried(self) -> bytes | None:
        return None if self.upsampler is None else self.upsampler.snapshot()

    def remember(self) -> dict[str, Any]:
        """Return the state as a tree for a snapshot."""
        return {
            "mpm": self.mpm.snapshot(),
            "moment": self.moment.remember(),
            "coarse": self._carried(),
            "backoff": dataclasses.asdict(self.backoff),
            "mode": self.mode,
            "log": [dataclasses.asdict(decision) for decision in self.log],
            "checkpoints": [kept.remember() for kept in self.checkpoints],
            "entries": [kept.remember() for kept in self.entries],
        }

    def recalled(self, memory: dict[str, Any]) -> Self:
        """Return the state that `remember` returned, with the scene, network and guards of this one.

        Raises
        ------
        SnapshotError
            It is of another scene or of other guards.
        """
        mpm = self.mpm.copy()
        mpm.restore(memory["mpm"])
        if memory["mode"] not in get_args(Mode):
            raise SnapshotError(f"the snapshot holds an unknown mode {memory['mode']!r}")
        return dataclasses.replace(
            self,
            mpm=mpm,
            upsampler=recalled_upsampler(self.upsampler, memory["coarse"]),
            moment=self.moment.recalled(memory["moment"]),
            backoff=Backoff(**memory["backoff"]),
            mode=memory["mode"],
            log=[Decision(**decision) for decision in memory["log"]],
            checkpoints=self._recalled(memory["checkpoints"]),
            entries=self._recalled(memory["entries"]),
        )

    def _recalled(self, trees: list[dict[str, Any]]) -> list[Checkpoint]:
        return [
            Checkpoint(self.moment.recalled(kept["moment"]), kept["mpm"], kept["coarse"]) for kept in trees
        ]

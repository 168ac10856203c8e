"""State of a hybrid simulation: one record for copies, checkpoints and snapshots."""

import copy
import dataclasses
from dataclasses import dataclass, field
from typing import Any, Self, get_args

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.coarse import Upsampler
from hybridmpm.coarse.upsampler import CoarseParticles, restored
from hybridmpm.decisions import Decision, Mode, StepCounts, StepSource
from hybridmpm.errors import SnapshotError
from hybridmpm.hybrid.guard import Guard
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.track import Track

_Floats = npt.NDArray[np.float32]
_NEAR = 8
"""Number of the latest network steps before each of which a checkpoint is kept."""
_APART, _FAR = 10, 4
"""Steps between older checkpoints, and their number."""
_MAX_DOUBLINGS = 2
"""Doublings of the wait of a network that fails repeatedly."""


@dataclass
class Backoff:
    """Number of calm steps that MPM simulates before the network may take over.

    The number is 0 at the start, then `wait`. It is doubled each time that the network fails before it has
    made as many steps as it had waited for, and halved where it made more.
    """

    wait: int
    calm_steps: int = 0
    """Consecutive MPM steps so far without an objection of a guard."""
    required_calm_steps: int = 0
    """Consecutive calm MPM steps required before the network resumes."""
    doublings: int = 0
    """Number of times that the wait is doubled at present, at most 2."""

    @property
    def is_over(self) -> bool:
        """Whether the network may take over."""
        return self.calm_steps >= self.required_calm_steps

    def count(self, *, is_calm: bool) -> None:
        """Count a step of MPM."""
        self.calm_steps = self.calm_steps + 1 if is_calm else 0

    def restart(self, *, steps: int = 0, is_fault: bool = False) -> None:
        """Start a new wait, because MPM takes over.

        Parameters
        ----------
        steps : int
            Number of steps that the network made.
        is_fault : bool
            Whether the network failed.
        """
        if steps > max(self.required_calm_steps, self.wait):
            self.doublings = max(self.doublings - 1, 0)
        elif is_fault:
            self.doublings = min(self.doublings + 1, _MAX_DOUBLINGS)
        self.calm_steps, self.required_calm_steps = 0, self.wait * 2**self.doublings


@dataclass
class NetworkState:
    """State of network, history and guards at one instant; a rollback restores it together with MPM's."""

    track: Track
    """The network's latest states, and its step under way."""
    history: _core.AccelerationHistory
    """Accelerations of the last two windows of time."""
    guards: tuple[Guard, ...]
    frame: int = 0
    """Number of frames since the start."""
    steps: int = 0
    """Number of steps since the last frame of MPM."""
    network_steps: int = 0
    """Consecutive most recent steps computed by the network itself."""
    safeguard: float | None = None
    """Mean cosine between the accelerations of the two windows; None until both are full."""
    end_velocities: tuple[_Floats, _Floats] | None = None
    """Velocities (n, D) [m/s] at the two ends of the network's step under way."""
    source: StepSource = "network"
    """Source of the network's step under way, or of the latest one."""
    counts: StepCounts = field(default_factory=StepCounts)
    """Frames that MPM did not simulate, by source."""

    def tick(self) -> None:
        """Count a frame of the network's step."""
        self.frame += 1
        self.counts = self.counts.with_frame(self.source)

    def copy(self) -> "NetworkState":
        """Return an independent state with the same network."""
        return dataclasses.replace(
            self,
            track=self.track.copy(),
            history=self.history.copy(),
            guards=tuple(guard.copy() for guard in self.guards),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the state as plain data, for a snapshot."""
        return {
            "track": self.track.to_dict(),
            "history": self.history.snapshot(),
            "guards": [{"name": guard.name, "state": guard.to_dict()} for guard in self.guards],
            "frame": self.frame,
            "steps": self.steps,
            "network_steps": self.network_steps,
            "safeguard": self.safeguard,
            "end_velocities": None if self.end_velocities is None else list(self.end_velocities),
            "source": self.source,
            "counts": dataclasses.asdict(self.counts),
        }

    def from_dict(self, tree: dict[str, Any]) -> "NetworkState":
        """Return the state that `to_dict` described, with the network and the guards of this one."""
        names = [kept["name"] for kept in tree["guards"]]
        if names != [guard.name for guard in self.guards]:
            raise SnapshotError(f"the snapshot was made with other guards: {', '.join(names) or 'none'}")
        track = self.track.from_dict(tree["track"])
        history = self.history.copy()
        history.restore(tree["history"])
        ends = tree["end_velocities"]
        return NetworkState(
            track=track,
            history=history,
            guards=tuple(
                guard.from_dict(kept["state"])
                for guard, kept in zip(self.guards, tree["guards"], strict=True)
            ),
            frame=tree["frame"],
            steps=tree["steps"],
            network_steps=tree["network_steps"],
            safeguard=tree["safeguard"],
            end_velocities=None if ends is None else (ends[0], ends[1]),
            source=tree["source"],
            counts=StepCounts(**tree["counts"]),
        )


@dataclass(frozen=True)
class Checkpoint:
    """A state to go back to."""

    network: NetworkState
    mpm: bytes
    """Snapshot of MPM."""
    shown: bytes | None
    """Snapshot of the upsampler; None without one."""

    def to_dict(self) -> dict[str, Any]:
        """Return the state as plain data, for a snapshot."""
        return {"network": self.network.to_dict(), "mpm": self.mpm, "shown": self.shown}


@dataclass
class HybridState:
    """Everything that changes while a hybrid simulation runs."""

    mpm: MpmSolver
    """MPM at the present state, or during a step of the network at the step's beginning."""
    network: NetworkState
    backoff: Backoff
    upsampler: Upsampler | None
    """Upsampler to all particles of the scene; None where those simulated are shown."""
    mode: Mode = "mpm"
    """Simulator of the next frame."""
    log: list[Decision] = field(default_factory=list)
    checkpoints: list[Checkpoint] = field(default_factory=list)
    """States to go back to, the oldest first: before each of the network's latest steps, and some older."""
    entries: list[Checkpoint] = field(default_factory=list)
    """States in which MPM handed over to the network, before the latest handover, the oldest first."""

    def copy(self, coarse: CoarseParticles | None = None) -> "HybridState":
        """Return an independent state with the same network; the upsampler reads `coarse` if given."""
        return dataclasses.replace(
            self,
            mpm=self.mpm.copy(),
            network=self.network.copy(),
            backoff=copy.copy(self.backoff),
            upsampler=None if self.upsampler is None else self.upsampler.copy(coarse),
            log=list(self.log),
            checkpoints=list(self.checkpoints),
            entries=list(self.entries),
        )

    def checkpoint(self) -> Checkpoint:
        """Return the present state, to go back to."""
        return Checkpoint(self.network.copy(), self.mpm.snapshot(), self._shown())

    def keep(self) -> None:
        """Keep the present state, to go back to, and thin out the older ones."""
        steps = self.network.steps
        older = [kept for kept in self.checkpoints if kept.network.steps <= steps - _NEAR]
        near = self.checkpoints[len(older) :]
        apart = [kept for kept in older if kept.network.steps % _APART == 0]
        self.checkpoints = [*apart[-_FAR:], *near, self.checkpoint()]

    def begin_with_present(self, since: int) -> None:
        """Keep the present state, in which the network takes over, and such states since a frame."""
        older = [*self.entries, *self.checkpoints[:1]]
        self.entries = [kept for kept in older if kept.network.frame >= since][-_FAR:]
        self.checkpoints = [self.checkpoint()]

    def forget(self) -> None:
        """Drop all states to go back to."""
        self.checkpoints, self.entries = [], []

    @property
    def can_go_back(self) -> bool:
        """Whether there is a state to go back to."""
        return bool(self.checkpoints or self.entries)

    def go_back(self) -> None:
        """Go back to the latest state that is kept, and drop it from those kept."""
        self.take_back((self.checkpoints or self.entries).pop())

    def take_back(self, checkpoint: Checkpoint) -> None:
        """Go back to a state. Log, backoff and other checkpoints stay."""
        self.mpm.restore(checkpoint.mpm)
        self.network = checkpoint.network.copy()
        self.upsampler = restored(self.upsampler, checkpoint.shown)

    def _shown(self) -> bytes | None:
        return None if self.upsampler is None else self.upsampler.snapshot()

    def to_dict(self) -> dict[str, Any]:
        """Return the state as plain data, for a snapshot."""
        return {
            "mpm": self.mpm.snapshot(),
            "network": self.network.to_dict(),
            "shown": self._shown(),
            "backoff": dataclasses.asdict(self.backoff),
            "mode": self.mode,
            "log": [dataclasses.asdict(decision) for decision in self.log],
            "checkpoints": [kept.to_dict() for kept in self.checkpoints],
            "entries": [kept.to_dict() for kept in self.entries],
        }

    def from_dict(self, tree: dict[str, Any]) -> Self:
        """Return the state that `to_dict` described, with the scene, network and guards of this one.

        Raises
        ------
        SnapshotError
            The state belongs to another scene or to other guards.
        """
        mpm = self.mpm.copy()
        mpm.restore(tree["mpm"])
        if tree["mode"] not in get_args(Mode):
            raise SnapshotError(f"the snapshot holds an unknown mode {tree['mode']!r}")
        return dataclasses.replace(
            self,
            mpm=mpm,
            upsampler=restored(self.upsampler, tree["shown"]),
            network=self.network.from_dict(tree["network"]),
            backoff=Backoff(**tree["backoff"]),
            mode=tree["mode"],
            log=[Decision(**decision) for decision in tree["log"]],
            checkpoints=self._checkpoints(tree["checkpoints"]),
            entries=self._checkpoints(tree["entries"]),
        )

    def _checkpoints(self, trees: list[dict[str, Any]]) -> list[Checkpoint]:
        return [
            Checkpoint(self.network.from_dict(kept["network"]), kept["mpm"], kept["shown"]) for kept in trees
        ]

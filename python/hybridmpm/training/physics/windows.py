"""Training samples: windows of successive states, drawn and mirrored at random, with noise added."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from hybridmpm._core import radius_graph
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import DataError
from hybridmpm.physics.spec import HISTORY
from hybridmpm.scene.particle_types import KINEMATIC
from hybridmpm.training.physics.network.edges import EdgeList
from hybridmpm.training.sources import scene_of

_Floats = npt.NDArray[np.float32]
_PUSH = 2.0
"""Acceleration besides the known one [m/s^2] from which on a particle does not fall freely."""
_PUSHED_SHARE = 0.01
"""Share of the particles that have to be pushed for a motion to be more than free fall."""
_AHEAD = 5
"""Number of steps before the first push that are drawn, too: bodies are near, and not yet in touch."""


@dataclass(frozen=True, kw_only=True)
class Batch:
    """B windows, each of `HISTORY` states and the K states after these; N particles, window by window."""

    history: Tensor
    """Positions (6, N, D) [m] that the network is given, oldest first."""
    targets: Tensor
    """Positions (K, N, D) [m] after these."""
    acceleration: Tensor
    """Known acceleration (K, N, D) [m/s^2]: gravity plus the force of the data set."""
    types: Tensor
    """DeepMind's particle types, int64 (N,)."""
    walls: Tensor
    """Lower and upper corner (2, N, D) [m] of the walls of each particle's scene."""
    counts: tuple[int, ...]
    """Number of particles of each window."""

    def to(self, device: torch.device) -> "Batch":
        """Return the batch on a device."""
        return Batch(
            history=self.history.to(device),
            targets=self.targets.to(device),
            acceleration=self.acceleration.to(device),
            types=self.types.to(device),
            walls=self.walls.to(device),
            counts=self.counts,
        )

    @property
    def moving(self) -> Tensor:
        """Whether a particle is not kinematic, bool (N,)."""
        return self.types != KINEMATIC


def edges_of(x: Tensor, types: Tensor, counts: Sequence[int], radius: float) -> EdgeList:
    """Return the edges between particles at x (N, D) [m] that are of one window and within the radius [m]."""
    points, kinds = x.detach().cpu().numpy(), types.cpu().numpy()
    senders, receivers, first = [], [], 0
    for count in counts:
        part = slice(first, first + count)
        graph = radius_graph(np.ascontiguousarray(points[part]), radius, kinds[part], kinematic=KINEMATIC)
        senders.append(graph.senders.astype(np.int64) + first)
        receivers.append(graph.receivers.astype(np.int64) + first)
        first += count
    return EdgeList(
        torch.from_numpy(np.concatenate(senders)).to(x.device),
        torch.from_numpy(np.concatenate(receivers)).to(x.device),
        counts,
    )


class Windows:
    """All windows of trajectories, which are in memory, but for those of free fall.

    Free fall teaches nothing: it is known, and the network's answer does not count there. So windows begin
    shortly before something but gravity and force moves the particles.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        Trajectories with their scenes, which give walls and gravity.
    unroll : int
        Largest number K of targets of `draw`.
    step_dt : float
        Time from one state to the next [s].

    Raises
    ------
    DataError
        A trajectory has no scene, or no trajectory is long enough.
    """

    def __init__(self, trajectories: Sequence[Trajectory], unroll: int, *, step_dt: float) -> None:
        for trajectory in trajectories:
            scene_of(trajectory)
        length = HISTORY + unroll
        self._trajectories = [t for t in trajectories if len(t.positions) >= length]
        if not self._trajectories:
            most = max((len(t.positions) for t in trajectories), default=0)
            raise DataError(
                f"no trajectory has the {length} states that a training sample needs, the longest has "
                f"{most}: make trajectories of more frames, or lower r_t or unroll"
            )
        self._starts = [max(0, first_push(one, step_dt) - HISTORY - _AHEAD) for one in self._trajectories]

    def draw(self, rng: np.random.Generator, *, size: int, unroll: int, noise_std: float) -> Batch:
        """Draw `size` windows at random.

        Parameters
        ----------
        rng : Generator
        size : int
            Number B of windows.
        unroll : int
            Number K of targets.
        noise_std : float
            Standard deviation of the noise on the last velocity [m per step]. The noise is a random walk over
            the window, as in the reference implementation of Sanchez-Gonzalez et al. (2020). Targets are
            moved by the noise of the last position, so that the network learns to correct velocities, not
            positions.
        """
        parts = [self._window(rng, unroll, noise_std) for _ in range(size)]
        columns = list(zip(*parts, strict=True))
        join = [np.concatenate(column, axis=1) for column in columns[:4]]
        return Batch(
            history=torch.from_numpy(join[0]),
            targets=torch.from_numpy(join[1]),
            acceleration=torch.from_numpy(join[2]),
            walls=torch.from_numpy(join[3]),
            types=torch.from_numpy(np.concatenate(columns[4])),
            counts=tuple(len(types) for types in columns[4]),
        )

    def _window(
        self, rng: np.random.Generator, unroll: int, noise_std: float
    ) -> tuple[_Floats, _Floats, _Floats, _Floats, npt.NDArray[np.int64]]:
        number = int(rng.integers(len(self._trajectories)))
        trajectory = self._trajectories[number]
        last = len(trajectory.positions) - HISTORY - unroll
        first = int(rng.integers(min(self._starts[number], last), last + 1))
        states = trajectory.positions[first : first + HISTORY + unroll].copy()
        acceleration, corners = known_acceleration(trajectory, first + HISTORY - 1, unroll)
        _mirror(rng, states, acceleration, corners)
        noise = _random_walk(rng, states[:HISTORY].shape, noise_std)
        noise[:, trajectory.types == KINEMATIC] = 0.0
        walls = np.broadcast_to(corners[:, None], (2, *states.shape[1:]))
        return states[:HISTORY] + noise, states[HISTORY:] + noise[-1], acceleration, walls, trajectory.types


def first_push(trajectory: Trajectory, step_dt: float) -> int:
    """Return the number of the first state that more than free fall follows; 0 where none does."""
    moving = trajectory.types != KINEMATIC
    known, _ = known_acceleration(trajectory, 0, len(trajectory.positions) - 1)
    found = np.diff(trajectory.positions[:, moving].astype(np.float64), n=2, axis=0) / step_dt**2
    pushed = np.linalg.norm(found - known[1:, moving], axis=2) > _PUSH
    states = np.flatnonzero(pushed.mean(axis=1) > _PUSHED_SHARE)
    return int(states[0]) + 1 if len(states) else 0


def known_acceleration(trajectory: Trajectory, first: int, count: int) -> tuple[_Floats, _Floats]:
    """Return gravity plus force (count, N, D) [m/s^2] from the state `first` on, and the walls (2, D) [m].

    Raises
    ------
    DataError
        The trajectory has no scene.
    """
    scene = scene_of(trajectory)
    acceleration = np.empty((count, *trajectory.positions.shape[1:]), dtype=np.float32)
    acceleration[:] = np.array(scene.gravity, dtype=np.float32)
    if trajectory.force is not None:
        acceleration += trajectory.force[first : first + count]
    return acceleration, np.array([scene.walls.lower, scene.walls.upper], dtype=np.float32)


def _mirror(rng: np.random.Generator, states: _Floats, acceleration: _Floats, corners: _Floats) -> None:
    """Mirror states and acceleration in place along each horizontal axis with probability 1/2.

    The physics is the same to the left and to the right.
    """
    for axis in (0, 2)[: states.shape[-1] - 1]:
        if rng.random() < 0.5:
            states[..., axis] = corners[0, axis] + corners[1, axis] - states[..., axis]
            acceleration[..., axis] *= -1.0


def _random_walk(rng: np.random.Generator, shape: tuple[int, ...], noise_std: float) -> _Floats:
    steps = rng.standard_normal((shape[0] - 1, *shape[1:]), dtype=np.float32)
    velocity = np.cumsum(steps * np.float32(noise_std / np.sqrt(shape[0] - 1)), axis=0)
    return np.concatenate([np.zeros((1, *shape[1:]), np.float32), np.cumsum(velocity, axis=0)])

"""Statistics of trajectories in one pass, so that a data set need not fit in memory."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import DataError
from hybridmpm.scene.particle_types import KINEMATIC

_Floats = npt.NDArray[np.float64]


class Moments:
    """Mean and standard deviation of vectors that come in parts (Chan, Golub and LeVeque 1983, Eq. 2.1)."""

    def __init__(self) -> None:
        self.count = 0
        self._mean: _Floats = np.zeros(0)
        self._squares: _Floats = np.zeros(0)

    def add(self, vectors: npt.NDArray[np.floating]) -> None:
        """Add vectors (..., D) to the sample."""
        rows = vectors.reshape(-1, vectors.shape[-1]).astype(np.float64)
        if not len(rows):
            return
        mean = rows.mean(axis=0)
        squares = ((rows - mean) ** 2).sum(axis=0)
        if not self.count:
            self._mean, self._squares = np.zeros_like(mean), np.zeros_like(mean)
        total = self.count + len(rows)
        delta = mean - self._mean
        self._squares += squares + delta**2 * self.count * len(rows) / total
        self._mean = self._mean + delta * len(rows) / total
        self.count = total

    @property
    def mean(self) -> list[float]:
        """Mean along each axis, D numbers; empty before the first vector."""
        return [float(number) for number in self._mean]

    @property
    def std(self) -> list[float]:
        """Standard deviation of the population along each axis, D numbers; empty before the first vector."""
        return [float(number) for number in np.sqrt(self._squares / max(self.count, 1))]


@dataclass(kw_only=True)
class Statistics:
    """Statistics of trajectories, in DeepMind's convention.

    Velocities are differences of successive states, and accelerations are differences of successive
    velocities. Both are per state and not per second, and leave out kinematic particles.
    """

    velocity: Moments = field(default_factory=Moments)
    """Mean and standard deviation of velocities [m per state]."""
    acceleration: Moments = field(default_factory=Moments)
    """Mean and standard deviation of accelerations [m per state^2]."""
    trajectories: int = 0
    """Number of trajectories."""
    dim: int = 0
    """Dimension of the trajectories, 0 before the first."""
    particles: list[int] = field(default_factory=list)
    """Number of particles of each trajectory, kinematic ones included."""
    states: list[int] = field(default_factory=list)
    """Number of states of each trajectory."""
    types: dict[int, int] = field(default_factory=dict)
    """Number of particles of each type, over all trajectories."""
    controls: dict[str, int] = field(default_factory=dict)
    """Number of controlled trajectories by their sketch and start, e.g. "arrow, live"."""

    def add(self, trajectory: Trajectory) -> None:
        """Add a trajectory.

        Raises
        ------
        DataError
            Its dimension differs from that of the trajectories before it.
        """
        states, count, dim = trajectory.positions.shape
        if self.dim and dim != self.dim:
            place = trajectory.place
            text = f"has dimension {dim}, those before it {self.dim}"
            raise DataError(f"{place.file}: {place.position} {text}")
        self.dim = dim
        moving = trajectory.positions[:, trajectory.types != KINEMATIC].astype(np.float64)
        velocity = np.diff(moving, axis=0)
        self.velocity.add(velocity)
        self.acceleration.add(np.diff(velocity, axis=0))
        self.trajectories += 1
        self.particles.append(count)
        self.states.append(states)
        for number, members in zip(*np.unique(trajectory.types, return_counts=True), strict=True):
            self.types[int(number)] = self.types.get(int(number), 0) + int(members)
        if trajectory.control is not None:
            name = trajectory.control.name
            self.controls[name] = self.controls.get(name, 0) + 1

    def metadata(self) -> dict[str, list[float]]:
        """Return the statistics of velocities and accelerations under DeepMind's keys."""
        return {
            "vel_mean": self.velocity.mean,
            "vel_std": self.velocity.std,
            "acc_mean": self.acceleration.mean,
            "acc_std": self.acceleration.std,
        }


def statistics(trajectories: Iterable[Trajectory]) -> Statistics:
    """Return the statistics of trajectories; raises `DataError` as reading them does."""
    total = Statistics()
    for trajectory in trajectories:
        total.add(trajectory)
    return total

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
        """Take in vectors (..., D)."""
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
        """One number an axis; empty where nothing was added."""
        return [float(number) for number in self._mean]

    @property
    def std(self) -> list[float]:
        """Of the population, one number an axis."""
        return [float(number) for number in np.sqrt(self._squares / max(self.count, 1))]


@dataclass(kw_only=True)
class Statistics:
    """What `metadata.json` tells of positions.

    Velocities are differences of successive states and accelerations differences of those, both per state
    and not per second, of all particles that are not kinematic: DeepMind's convention.
    """

    velocity: Moments = field(default_factory=Moments)
    """[m per state]."""
    acceleration: Moments = field(default_factory=Moments)
    """[m per state^2]."""
    trajectories: int = 0
    dim: int = 0
    particles: list[int] = field(default_factory=list)
    """Of each trajectory, the kinematic ones among them."""
    states: list[int] = field(default_factory=list)
    """Of each trajectory."""
    types: dict[int, int] = field(default_factory=dict)
    """Particles of each type, over all trajectories."""

    def add(self, trajectory: Trajectory) -> None:
        """Take in one trajectory.

        Raises
        ------
        DataError
            Its dimension is not that of the others.
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

    def metadata(self) -> dict[str, list[float]]:
        """Return the statistics under DeepMind's keys."""
        return {
            "vel_mean": self.velocity.mean,
            "vel_std": self.velocity.std,
            "acc_mean": self.acceleration.mean,
            "acc_std": self.acceleration.std,
        }


def statistics(trajectories: Iterable[Trajectory]) -> Statistics:
    """Take in each trajectory in turn; raises what reading them does."""
    total = Statistics()
    for trajectory in trajectories:
        total.add(trajectory)
    return total

"""`Ways`: where each particle goes, and along which way; and what that takes in a given time."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.control.goal.cloud import EARTH, Cloud, Floats

_SHARE = 0.95
"""Share of the mass that a needed acceleration is told for; a few drops far off would set it otherwise."""


@dataclass(frozen=True, eq=False)
class Ways:
    """Places of N particles, and ways of G groups of them with K corners in all, in D dimensions."""

    places: Floats
    """Where each particle is to be (N, D) [m]."""
    group: npt.NDArray[np.uint32]
    """Group of each particle (N,)."""
    starts: npt.NDArray[np.uint32]
    """(G + 1,): the way of group g has the corners `starts[g]` to `starts[g + 1] - 1`, two or more."""
    corners: Floats
    """Corners of all ways (K, D) [m]: start, corners on the way, end."""
    velocity: Floats
    """Velocity of each group at the start (G, D) [m/s]."""
    weight: Floats
    """Mass of each group over that of all (G,) [-]."""
    cut_off: npt.NDArray[np.bool_]
    """Whether walls and obstacles leave no way to a group's places (G,)."""

    @classmethod
    def of_groups(
        cls,
        cloud: Cloud,
        places: Floats,
        group: npt.NDArray[np.uint32],
        starts: npt.NDArray[np.uint32],
        corners: Floats,
        *,
        cut_off: npt.NDArray[np.bool_],
    ) -> "Ways":
        """Add what the particles of a cloud say of their groups."""
        weight = np.bincount(group, cloud.weight, len(cut_off)).astype(np.float64)
        momentum = [np.bincount(group, cloud.weight * column, len(cut_off)) for column in cloud.v.T]
        velocity = np.stack(momentum, axis=1) / weight[:, None]
        return cls(places, group, starts, corners, velocity, weight, cut_off)

    @property
    def offset(self) -> Floats:
        """Distance of each particle's place from the end of its group's way (N, D) [m]."""
        return np.asarray(self.places - self.corners[self.starts[1:] - 1][self.group])

    def timed(self, seconds: float) -> "Motion":
        """Time all ways so that each takes the least acceleration and ends at rest."""
        times = np.zeros(len(self.corners))
        v = np.zeros_like(self.corners)
        straight = np.diff(self.starts) == 2
        first = self.starts[:-1][straight]
        times[first + 1] = seconds
        v[first] = self.velocity[straight]
        rest = [0.0] * self.corners.shape[1]
        for group in np.flatnonzero(~straight):
            knots = slice(self.starts[group], self.starts[group + 1])
            points = np.ascontiguousarray(self.corners[knots])
            timing = _native.least_acceleration(points, self.velocity[group].tolist(), rest, seconds)
            times[knots], v[knots] = timing.times, timing.velocities
        return Motion(self, times, v)


@dataclass(frozen=True, eq=False)
class Motion:
    """Ways with their times."""

    ways: Ways
    times: Floats
    """When each corner is passed (K,), from 0 on [s]."""
    v: Floats
    """Velocity in each corner (K, D) [m/s]."""

    def effort(self, gravity: Floats, *, slower: float = 1.0) -> "Effort":
        """Return the accelerations besides gravity that the motion takes, in g.

        With `slower` the times are that many times as long, and the first piece takes up the start velocity.
        """
        ways = self.ways
        inner = np.ones(len(self.times), dtype=bool)
        inner[ways.starts[1:] - 1] = False
        left = np.flatnonzero(inner)
        h = slower * np.diff(self.times)[left][:, None]
        slope = np.diff(ways.corners, axis=0)[left] / h
        v0, v1 = self.v[left] / slower, self.v[left + 1] / slower
        firsts = np.searchsorted(left, ways.starts[:-1])
        v0[firsts] = ways.velocity
        a0 = (6 * slope - 4 * v0 - 2 * v1) / h - gravity
        a1 = (2 * v0 + 4 * v1 - 6 * slope) / h - gravity
        peak = np.sqrt(np.maximum((a0**2).sum(axis=1), (a1**2).sum(axis=1)))
        square = h[:, 0] / 3 * (a0**2 + a0 * a1 + a1**2).sum(axis=1)
        seconds = np.add.reduceat(h[:, 0], firsts)
        mean_square = np.add.reduceat(square, firsts) / seconds
        peaks = np.maximum.reduceat(peak, firsts)
        order = np.argsort(peaks, kind="stable")
        enough = int(np.searchsorted(np.cumsum(ways.weight[order]), _SHARE))
        return Effort(
            acceleration=float(peaks[order][min(enough, len(peaks) - 1)] / EARTH),
            peak=float(peaks.max() / EARTH),
            rms=float(np.sqrt(ways.weight @ mean_square) / EARTH),
        )


@dataclass(frozen=True)
class Effort:
    """Accelerations besides gravity that a motion takes at least, in g = 9.81 m/s^2."""

    acceleration: float
    """Largest one on 95 % of the mass."""
    peak: float
    """Largest one of all groups."""
    rms: float
    """Root of the mean square over mass and time: the least-force bound."""

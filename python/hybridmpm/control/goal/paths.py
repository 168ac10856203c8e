"""`Paths` of the particles to their places, and the path of their centre of mass along an arrow."""

import dataclasses
import heapq
import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.control.goal.cloud import EARTH, Cloud, Floats
from hybridmpm.control.goal.room import Room, RoomGrid
from hybridmpm.control.sketch.sketch import Arrow, depth_of_width
from hybridmpm.scene import Walls

SHORTEST_FRAMES = _core.SHORTEST_FRAMES
_SHARE = 0.95
"""Share of the mass that a needed acceleration is given for, so that a few drops far off do not set it."""
_TOLERANCE = 0.008
"""Largest distance of a drawn point from the simplified path, over the longest side of the world; a hand
trembles by less."""
_CORNERS = 64
"""Largest number of points of the simplified path. The time to plan grows with their square, and no fluid
follows so many bends."""
_EARLY = 0.2
"""Part of a path around obstacles on which a body takes the shape that it has at the tip."""
_STEPS = 33
"""Number of places at which a straight way is looked at for the first obstacle."""
_PASSING = 0.97
"""Share of the particles that must be free for others to go on."""
_LOOKS = 16
"""Places on a piece of a path that are held against obstacles."""
_PIECES = 8
"""Smallest number of pieces of a bent path, so that the spline through them stays near to it."""


def arrow_path(arrow: Arrow, dim: int, walls: Walls, unit: float) -> Floats:
    """Return points (K, D) [m] of the path of an arrow, from 0 on, K >= 2; `unit` as in `cornered`.

    Points on a line between others are left out; a straight arrow has two. In 3D the widths of the stroke
    give the depth; without widths the depth is constant.
    """
    points = np.array(arrow.points)
    if dim == 3:
        depth = np.zeros(len(points))
        if arrow.widths is not None:
            back, front = walls.lower[2], walls.upper[2]
            depth = np.array([depth_of_width(float(width), back, front) for width in arrow.widths])
        points = np.column_stack([points, depth])
    return cornered(points - points[0], unit)


def cornered(points: Floats, unit: float) -> Floats:
    """Return corners (K, D) of a path (M, D), near enough to each other that a spline stays near to it.

    `unit` is the longest side of the world [m].
    """
    few = _simplified(points, _TOLERANCE * unit)
    if len(few) == 2:
        return few
    lengths = np.linalg.norm(np.diff(few, axis=0), axis=1)
    longest = lengths.sum() / _PIECES
    path = [few[:1]]
    for start, end, length in zip(few[:-1], few[1:], lengths, strict=True):
        steps = np.linspace(0, 1, int(np.ceil(length / longest - 1e-9)) + 1)[1:, None]
        path.append(start + steps * (end - start))
    return np.concatenate(path)


def _simplified(points: Floats, tolerance: float) -> Floats:
    """Leave out points near to lines between others (Ramer 1972; Douglas and Peucker 1973).

    At most `_CORNERS` points are kept, those that lie farthest off.
    """
    kept = [0, len(points) - 1]
    gaps = [_farthest(points, *kept)]
    while len(kept) < _CORNERS and -gaps[0][0] > tolerance:
        _, middle, first, last = heapq.heappop(gaps)
        kept.append(middle)
        heapq.heappush(gaps, _farthest(points, first, middle))
        heapq.heappush(gaps, _farthest(points, middle, last))
    return np.asarray(points[sorted(kept)])


def _farthest(points: Floats, first: int, last: int) -> tuple[float, int, int, int]:
    """Return the negative distance [m] of the point farthest off a line between two, and the three points."""
    if last - first < 2:
        return 0.0, first, first, last
    inner = points[first + 1 : last]
    along = points[last] - points[first]
    square = float(along @ along)
    share = np.clip((inner - points[first]) @ along / max(square, 1e-18), 0, 1)
    away = np.linalg.norm(inner - points[first] - share[:, None] * along, axis=1)
    worst = int(np.argmax(away))
    return -float(away[worst]), first + 1 + worst, first, last


@dataclass(frozen=True, eq=False)
class Paths:
    """Places of N particles, and paths of G groups of them with K corners in all, in D dimensions."""

    places: Floats
    """Place of each particle at the end (N, D) [m]."""
    group: npt.NDArray[np.uint32]
    """Group of each particle (N,)."""
    starts: npt.NDArray[np.uint32]
    """(G + 1,): the path of group g has the corners `starts[g]` to `starts[g + 1] - 1`, two or more."""
    corners: Floats
    """Corners of all paths (K, D) [m]: start, inner corners, end."""
    velocity: Floats
    """Velocity of each group at the start (G, D) [m/s]; that of all for `together`."""
    weight: Floats
    """Mass of each group over that of all (G,) [-]."""
    cut_off: npt.NDArray[np.bool_]
    """Whether walls and obstacles cut a group off from its places (G,)."""
    together: bool
    """Whether all groups pass their corners at the same times, as parts of one body do along an arrow; all
    paths then have equally many corners."""
    pace: Floats | None = None
    """Path (K, D) [m] that times those who go together; None for that of their centre of mass."""
    end: Floats | None = None
    """Velocity of all at the end (D,) [m/s]; None for rest."""

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
        together: bool = False,
    ) -> "Paths":
        """Return paths of groups, with the masses and velocities of their particles in a cloud."""
        weight = np.bincount(group, cloud.weight, len(cut_off)).astype(np.float64)
        momentum = [np.bincount(group, cloud.weight * column, len(cut_off)) for column in cloud.v.T]
        velocity = np.stack(momentum, axis=1) / weight[:, None]
        if together:
            # The inner corners are too near to the start for own velocities to even out by the first.
            velocity = np.tile(cloud.mean_velocity, (len(weight), 1))
        return cls(places, group, starts, corners, velocity, weight, cut_off, together)

    @classmethod
    def matched(
        cls, cloud: Cloud, cells: Floats, grid: RoomGrid | None, side: float | None = None
    ) -> "Paths":
        """Return paths on which groups fill cells (M, D) [m], each by the shortest way around obstacles.

        A place is the mean of some cells. With the side of a cell [m], places between two arms of a shape are
        moved into a cell.
        """
        found = _core.match_to_region(cloud.x, cells, None if grid is None else grid.space, side)
        return cls.of_groups(
            cloud, found.places, found.group, found.way_starts, found.ways, cut_off=found.cut_off
        )

    @classmethod
    def straight(cls, cloud: Cloud, places: Floats, group: npt.NDArray[np.uint32]) -> "Paths":
        """Return straight paths of groups, from their centres to the means of their particles' places."""
        sizes = np.bincount(group)[:, None]
        ends = [
            np.stack([np.bincount(group, column) for column in points.T], axis=1) / sizes
            for points in (cloud.x, places)
        ]
        corners = np.stack(ends, axis=1).reshape(-1, cloud.dim)
        starts = 2 * np.arange(len(sizes) + 1, dtype=np.uint32)
        return cls.of_groups(cloud, places, group, starts, corners, cut_off=np.zeros(len(sizes), dtype=bool))

    @classmethod
    def along(
        cls,
        path: Floats,
        cloud: Cloud,
        places: Floats,
        group: npt.NDArray[np.uint32],
        *,
        lower: Floats,
        upper: Floats,
        early: bool = False,
    ) -> "Paths":
        """Return paths of groups that go together along a path (K, D), each from its centre.

        The change of shape is proportional to the length of path gone, `early` over its first part only.
        Corners are clipped to `lower` and
        `upper`, (D,) each [m].
        """
        straight = cls.straight(cloud, places, group)
        start, end = straight.corners.reshape(-1, 2, cloud.dim).swapaxes(0, 1)
        lengths = np.append(0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
        done = np.minimum(1.0, lengths / (lengths[-1] * (_EARLY if early else 1.0)))[:, None]
        shift = path - path[0]
        change = end - start - shift[-1]
        corners = np.clip(start[:, None] + shift + done * change[:, None], lower, upper)
        starts = len(path) * np.arange(len(start) + 1, dtype=np.uint32)
        corners = corners.reshape(-1, cloud.dim)
        return cls.of_groups(cloud, places, group, starts, corners, cut_off=straight.cut_off, together=True)

    def shortened(self, share: float) -> "Paths":
        """Return paths that end after a share in [0, 1] of their lengths; places move with their ends."""
        corners = self.corners.copy()
        for first, last in itertools.pairwise(self.starts.astype(int)):
            path = self.corners[first:last]
            done = np.append(0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
            for axis, along in enumerate(path.T):
                corners[first:last, axis] = np.interp(share * done, done, along)
        ends = self.starts[1:] - 1
        places = self.places + (corners - self.corners)[ends][self.group]
        return dataclasses.replace(self, places=places, corners=corners)

    def shifted(self, by: Floats) -> "Paths":
        """Return paths whose ends are shifted by a vector (D,) [m], with all places."""
        corners = self.corners.copy()
        corners[self.starts[1:] - 1] += by
        return dataclasses.replace(self, places=self.places + by, corners=corners)

    def held_back(self, x: Floats, room: Room) -> "Paths":
        """Return paths on which those who are cut off go straight on, in their shape, until something is hit.

        Parameters
        ----------
        x : (N, D)
            Positions of the particles at the start [m].
        room : Room
        """
        if not self.cut_off.any():
            return self
        members = self.cut_off[self.group]
        way = (self.places - x)[members].mean(axis=0)
        steps = np.linspace(0, 1, _STEPS)
        free = [bool(room.is_free(x[members] + step * way).mean() >= _PASSING) for step in steps[1:]]
        reach = steps[free.index(False) if False in free else _STEPS - 1]
        places, corners = self.places.copy(), self.corners.copy()
        places[members] = x[members] + reach * way
        firsts = self.starts[:-1][self.cut_off]
        corners[firsts + 1] = corners[firsts] + reach * way
        return dataclasses.replace(self, places=places, corners=corners)

    def blocked(self, room: Room) -> npt.NDArray[np.bool_]:
        """Return which paths lead through obstacles, their starts aside, (G,)."""
        steps = np.linspace(0, 1, _LOOKS + 1)[1:, None, None]
        points = self.corners[:-1] + steps * np.diff(self.corners, axis=0)
        hit = (room.distance(points.reshape(-1, points.shape[2])) < 0).reshape(points.shape[:2]).any(axis=0)
        hit = np.append(hit, False)
        hit[self.starts[1:] - 1] = False  # From the end of one path to the start of the next leads none.
        return np.asarray(np.logical_or.reduceat(hit, self.starts[:-1].astype(int)))

    def around(self, room: Room) -> "Paths":
        """Return straight paths, in place of those through obstacles the shortest ways around them."""
        grid, blocked = room.grid(), self.blocked(room)
        if grid is None or not blocked.any():
            return self
        ways, cut_off = list(self.corners.reshape(len(self.weight), 2, -1)), self.cut_off.copy()
        for group in np.flatnonzero(blocked):
            # A region of one cell: the way to its place is the shortest one.
            found = _core.match_to_region(ways[group][:1], ways[group][1:], grid.space)
            ways[group], cut_off[group] = found.ways, found.cut_off[0]
        starts = np.append(0, np.cumsum([len(way) for way in ways])).astype(np.uint32)
        return dataclasses.replace(self, starts=starts, corners=np.concatenate(ways), cut_off=cut_off)

    def passing(self, place: Floats, reach: float) -> float:
        """Return the share of the mass [-] whose path comes within a distance of a place (D,) [m]."""
        step = np.diff(self.corners, axis=0)
        square = np.maximum((step**2).sum(axis=1), 1e-18)
        along = np.clip(((place - self.corners[:-1]) * step).sum(axis=1) / square, 0, 1)
        away = np.linalg.norm(self.corners[:-1] + along[:, None] * step - place, axis=1)
        away = np.append(away, np.inf)
        away[self.starts[1:] - 1] = np.inf  # From the end of one path to the start of the next leads none.
        return float(self.weight @ (np.minimum.reduceat(away, self.starts[:-1].astype(int)) <= reach))

    @property
    def leads_around(self) -> bool:
        """Whether groups go around obstacles, each on a way of its own."""
        return not self.together and bool((np.diff(self.starts) > 2).any())

    @property
    def offset(self) -> Floats:
        """Distance of each particle's place from the end of its group's path (N, D) [m]."""
        return np.asarray(self.places - self.corners[self.starts[1:] - 1][self.group])

    def timed(self, seconds: float) -> "Motion":
        """Return all paths timed for the least acceleration, with `end` as the last velocity.

        Paths for `together` get the times of their mean.
        """
        if self.together:
            return self._timed_together(seconds)
        times = np.zeros(len(self.corners))
        v = np.zeros_like(self.corners)
        straight = np.diff(self.starts) == 2
        first = self.starts[:-1][straight]
        times[first + 1] = seconds
        v[first] = self.velocity[straight]
        end = [0.0] * self.corners.shape[1] if self.end is None else self.end.tolist()
        v[first + 1] = end
        for group in np.flatnonzero(~straight):
            knots = slice(self.starts[group], self.starts[group + 1])
            points = np.ascontiguousarray(self.corners[knots])
            timing = _core.least_acceleration(points, self.velocity[group].tolist(), end, seconds)
            times[knots], v[knots] = timing.times, timing.velocities
        return Motion(self, times, v)

    def _timed_together(self, seconds: float) -> "Motion":
        count, dim = len(self.weight), self.corners.shape[1]
        corners = self.corners.reshape(count, -1, dim)
        rest = [0.0] * dim
        end = np.zeros(dim) if self.end is None else self.end
        if self.pace is not None:
            timing = _core.least_acceleration(self.pace, rest, rest, seconds)
        else:
            mean = np.tensordot(self.weight, corners, axes=1)
            timing = _core.least_acceleration(mean, self.velocity[0].tolist(), end.tolist(), seconds)
        v = spline_velocities(timing.times, corners, self.velocity, end)
        return Motion(self, np.tile(timing.times, count), v.reshape(-1, dim))


def spline_velocities(times: Floats, corners: Floats, start: Floats, end: Floats) -> Floats:
    """Return the velocities (G, K, D) in the corners of cubic splines that share their times (K,).

    The velocities at the start are (G, D), those at the end (D,), and accelerations are continuous.
    """
    h = np.diff(times)
    v = np.zeros_like(corners)
    v[:, 0], v[:, -1] = start, end
    if len(h) > 1:
        slope = np.diff(corners, axis=1) / h[:, None]
        matrix = np.diag(2 / h[:-1] + 2 / h[1:]) + np.diag(1 / h[1:-1], 1) + np.diag(1 / h[1:-1], -1)
        right = 3 * (slope[:, :-1] / h[:-1, None] + slope[:, 1:] / h[1:, None])
        right[:, 0] -= start / h[0]
        right[:, -1] -= end / h[-1]
        # One inverse for all groups; numpy would factorise the matrix for each of them.
        v[:, 1:-1] = np.linalg.inv(matrix) @ right
    return v


@dataclass(frozen=True, eq=False)
class Motion:
    """Paths with their times."""

    paths: Paths
    times: Floats
    """Time of each corner (K,), from 0 on [s]."""
    v: Floats
    """Velocity in each corner (K, D) [m/s]."""

    def effort(self, gravity: Floats) -> "Effort":
        """Return the accelerations of the motion besides gravity, in g."""
        pieces = self._pieces()
        a0, a1 = (pieces.accelerations(end, np.ones(1), gravity)[0] for end in (0, 1))
        peaks = self._peaks(pieces, np.ones(1), gravity)[0]
        square = pieces.h / 3 * (a0**2 + a0 * a1 + a1**2).sum(axis=0)
        mean_square = np.add.reduceat(square, pieces.firsts) / np.add.reduceat(pieces.h, pieces.firsts)
        return Effort(
            acceleration=float(_on_most(peaks[None], self.paths.weight)[0] / EARTH),
            peak=float(peaks.max() / EARTH),
            rms=float(np.sqrt(self.paths.weight @ mean_square) / EARTH),
        )

    def slowed(self, factors: Floats, gravity: Floats) -> Floats:
        """Return `Effort.acceleration` (S,) for times multiplied by factors (S,).

        The first pieces absorb the start velocity, whatever the factor.
        """
        return _on_most(self._peaks(self._pieces(), factors, gravity), self.paths.weight) / EARTH

    def _peaks(self, pieces: "_Pieces", factors: Floats, gravity: Floats) -> Floats:
        """Return the largest acceleration of each group (S, G) [m/s^2] for times times factors (S,)."""
        ends = [pieces.accelerations(end, factors, gravity) for end in (0, 1)]
        if self.paths.pace is not None:
            # Pieces are shorter than the law looks ahead, so it levels them out.
            ends = [(ends[0] + ends[1]) / 2] * 2
        squares = [(one**2).sum(axis=1) for one in ends]  # (S, P)
        return np.sqrt(np.maximum.reduceat(np.maximum(*squares), pieces.firsts, axis=1))

    def _pieces(self) -> "_Pieces":
        paths = self.paths
        inner = np.ones(len(self.times), dtype=bool)
        inner[paths.starts[1:] - 1] = False
        left = np.flatnonzero(inner)
        h = np.diff(self.times)[left]
        firsts = np.searchsorted(left, paths.starts[:-1])
        slope = np.diff(paths.corners, axis=0)[left].T / h
        v0, v1 = self.v[left].T.copy(), self.v[left + 1].T
        v0[:, firsts] = 0
        start = np.zeros_like(v0)
        start[:, firsts] = paths.velocity.T
        # Inner velocities are divided by the factor; the velocity at the start is given.
        slowing = (6 * slope - 4 * v0 - 2 * v1) / h, (2 * v0 + 4 * v1 - 6 * slope) / h
        lasting = -4 * start / h, 2 * start / h
        return _Pieces(h, firsts, slowing, lasting)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Pieces (P,) of paths between corners, each with a linear acceleration in D dimensions."""

    h: Floats
    """Duration of each (P,) [s]."""
    firsts: npt.NDArray[np.intp]
    """The first piece of each group (G,)."""
    slowing: tuple[Floats, Floats]
    """Parts (D, P) of the accelerations at both ends that fall with the square of the time [m/s^2]."""
    lasting: tuple[Floats, Floats]
    """Parts (D, P) that fall with the time and absorb the start velocity [m/s^2]."""

    def accelerations(self, end: int, factors: Floats, gravity: Floats) -> Floats:
        """Return (S, D, P) at one end, 0 or 1, for times multiplied by factors (S,) [m/s^2]."""
        per_time = 1 / factors[:, None, None]
        return np.asarray(per_time * (per_time * self.slowing[end] + self.lasting[end]) - gravity[:, None])


def _on_most(peaks: Floats, weight: Floats) -> Floats:
    """Return the smallest numbers (S,) that peaks (S, G) stay below on 95 % of the mass."""
    order = np.argsort(peaks, axis=1, kind="stable")
    enough = (np.cumsum(weight[order], axis=1) < _SHARE).sum(axis=1)
    last = np.minimum(enough, len(weight) - 1)[:, None]
    return np.take_along_axis(np.take_along_axis(peaks, order, axis=1), last, axis=1)[:, 0]


@dataclass(frozen=True)
class Effort:
    """Least accelerations of a motion besides gravity, in g = 9.81 m/s^2."""

    acceleration: float
    """Largest one on 95 % of the mass."""
    peak: float
    """Largest one of all groups."""
    rms: float
    """Root of the mean square over mass and time: the least-force bound."""

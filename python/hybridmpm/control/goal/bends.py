"""`Bends`: the way of a body along an arrow, bent round obstacles and back between the walls."""

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.room import Room, RoomGrid

_SAMPLE = 160
"""Number of particles that stand for a body."""
STEP = 1 / 64
"""Distance at which a way is looked at, over the longest side of the world."""
_HIT = 0.02
"""Share of a body in obstacles from which on its way is blocked."""
_OUTSIDE = 0.1
"""Share of a body beyond a wall from which on its way leaves the room."""
_FARTHEST = 2.0
"""Distance of a node that stands for a start or an end, at least [spacings]."""
_BURDEN = 8.0
"""Factor by which a way counts longer where the whole body is nearer to obstacles than the clearance."""
_ROUNDED = 0.5
"""Depth up to which a body may lie in walls, and least distance that it keeps from obstacles: places are
rounded to nodes, and no obstacle is too thin to be seen [spacings]."""
_CLEARANCE = 1.5
"""Distance that a body keeps from obstacles where there is room [spacings]."""


def resampled(path: Floats, step: float) -> Floats:
    """Return points (M, D) along a path (K, D), its corners among them, at most `step` apart [m]."""
    pieces = [path[:1]]
    for start, end in itertools.pairwise(path):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / step)))
        pieces.append(start + np.linspace(0, 1, count + 1)[1:, None] * (end - start))
    return np.concatenate(pieces)


@dataclass(frozen=True, eq=False)
class Bends:
    """Particles of a body about its centre of mass, which change their places on the way to the tip."""

    room: Room
    offset: Floats
    """Places (S, D) about the centre at the start [m]."""
    change: Floats
    """Change of these places up to the tip (S, D) [m]; 0 where the body keeps its shape."""

    @classmethod
    def of(cls, room: Room, x: Floats, places: Floats, path: Floats) -> "Bends":
        """Return those of particles `x` (N, D) whose places at the end of a path (K, D) are (N, D) [m]."""
        few = slice(None, None, max(1, len(x) // _SAMPLE))
        return cls(room, x[few] - path[0], (places - path[-1])[few] - (x - path[0])[few])

    def centre(self) -> "Bends":
        """Return those of the centre of mass alone."""
        point = np.zeros((1, self.offset.shape[1]))
        return Bends(self.room, point, point)

    def _along(self, path: Floats) -> Floats:
        """Return the particles (M, S, D) at the points of a path."""
        lengths = np.append(0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
        done = lengths / max(lengths[-1], 1e-12)
        return np.asarray(path[:, None] + self.offset + done[:, None, None] * self.change)

    def hits(self, path: Floats) -> npt.NDArray[np.bool_]:
        """Return at which points of a path (M, D) obstacles are in the way of the body, (M,)."""
        x = self._along(path)
        inside = self.room.distance(x.reshape(-1, x.shape[2])) < 0
        return np.asarray(inside.reshape(x.shape[:2]).mean(axis=1) > _HIT)

    def within(self, path: Floats) -> Floats | None:
        """Return a path (M, D), moved back to where the body is between the walls; None where it is there.

        Start and tip stay where they are.
        """
        x = self._along(path)
        lower, upper = self.room.lower, self.room.upper
        beyond = np.maximum((x < lower).mean(axis=1), (x > upper).mean(axis=1)).max(axis=1)
        if not (beyond[1:-1] > _OUTSIDE).any():
            return None
        least, most = (np.quantile(x, q, axis=1) - path for q in (_HIT, 1 - _HIT))
        low, high = lower - least, upper - most
        moved = np.where(low <= high, np.clip(path, low, high), (low + high) / 2)
        moved[[0, -1]] = path[[0, -1]]
        return np.asarray(moved)

    def around(self, path: Floats, grid: RoomGrid) -> Floats | None:
        """Return a path (M, D) that keeps clear of obstacles with the whole body; None where there is none.

        Only the parts where something is in the way are replaced, and as much before and after them, each by
        the shortest way around.
        """
        blocked = self.hits(path)
        for first, last in _runs(blocked):
            more = last + 1 - first
            blocked[max(first - more, 0) : last + 1 + more] = True
        burden = self._burden(grid)
        reach = max(_FARTHEST * grid.spacing, float(np.linalg.norm(self.offset, axis=1).max()))
        pieces, here = [], 0
        for first, last in _runs(blocked):
            way = _shortest(burden, grid, path[first], path[last], reach)
            if way is None:
                return None
            pieces += [path[here:first], way]
            here = last + 1
        return np.concatenate([*pieces, path[here:]])

    def _burden(self, grid: RoomGrid) -> Floats:
        """Return for each node the factor by which a way of the centre counts longer there, D axes.

        It is infinite where the body does not fit.
        """
        nodes = grid.nodes.reshape(-1, grid.distance.ndim)
        slack = _ROUNDED * grid.spacing
        x = self.offset
        outside = [
            (
                (nodes[:, None, axis] + x[:, axis] < lower - slack)
                | (nodes[:, None, axis] + x[:, axis] > upper + slack)
            )
            for axis, (lower, upper) in enumerate(zip(self.room.lower, self.room.upper, strict=True))
        ]
        beyond = np.any(outside, axis=0).mean(axis=1)
        clearance = _CLEARANCE * grid.spacing
        near = np.flatnonzero(
            (beyond <= _HIT) & (grid.distance.ravel() < np.linalg.norm(x, axis=1).max() + clearance)
        )
        distance = self.room.distance((nodes[near, None] + x).reshape(-1, nodes.shape[1])).reshape(
            len(near), -1
        )
        burden = np.where(beyond <= _HIT, 1.0, np.inf)
        close = (distance < clearance).mean(axis=1)
        burden[near] = np.where((distance < slack).mean(axis=1) > _HIT, np.inf, 1 + _BURDEN * close)
        return burden.reshape(grid.distance.shape)


def _runs(marked: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first and the last index of each run of marks."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]


def _shortest(burden: Floats, grid: RoomGrid, start: Floats, end: Floats, reach: float) -> Floats | None:
    """Return the shortest way (M, D) between two points, both among its own; None where there is none."""
    first, last = (_nearest(burden, grid, point, reach) for point in (start, end))
    if first is None or last is None:
        return None
    dim = burden.ndim
    steps = [np.array(step) - 1 for step in np.ndindex(*[3] * dim) if any(np.array(step) != 1)]
    padded = np.pad(burden, 1, constant_values=np.inf)
    inner = (slice(1, -1),) * dim
    shifted = [
        tuple(slice(1 + along, padded.shape[axis] - 1 + along) for axis, along in enumerate(step))
        for step in steps
    ]
    price = [
        grid.spacing * np.linalg.norm(step) * (burden + padded[part]) / 2
        for step, part in zip(steps, shifted, strict=True)
    ]
    length = np.full(padded.shape, np.inf)
    length[inner][last] = 0
    while True:
        before = length[inner].copy()
        for part, cost in zip(shifted, price, strict=True):
            np.minimum(length[inner], length[part] + cost, out=length[inner])
        if np.array_equal(before, length[inner]):
            break
    if not np.isfinite(length[inner][first]):
        return None
    chain, here = [first], first
    while here != last:
        place = np.array(here) + 1
        values = [length[tuple(place + step)] + cost[here] for step, cost in zip(steps, price, strict=True)]
        here = tuple(int(along) for along in place - 1 + steps[int(np.argmin(values))])
        chain.append(here)
    return _taut(
        np.array([start, *(grid.lower + grid.spacing * np.array(node) for node in chain), end]), burden, grid
    )


def _nearest(burden: Floats, grid: RoomGrid, point: Floats, reach: float) -> tuple[int, ...] | None:
    """Return the nearest node in reach of a point where the body fits; None where it fits in none."""
    away = np.linalg.norm(grid.nodes - point, axis=-1)
    away[~np.isfinite(burden)] = np.inf
    best = int(np.argmin(away))
    if not away.flat[best] <= reach:
        return None
    return tuple(int(along) for along in np.unravel_index(best, away.shape))


def _taut(chain: Floats, burden: Floats, grid: RoomGrid) -> Floats:
    """Leave out the points of a chain (M, D) that straight lines without a greater burden pass by."""

    def worst(points: Floats) -> float:
        nodes = np.clip(np.round((points - grid.lower) / grid.spacing), 0, np.array(burden.shape) - 1)
        return float(burden[tuple(nodes.astype(int).T)].max())

    kept, here = [0], 0
    while here < len(chain) - 1:
        after = len(chain) - 1
        while after > here + 1:
            line = resampled(chain[[here, after]], grid.spacing / 2)
            if worst(line[1:-1]) <= worst(chain[here + 1 : after]) + 1e-9:
                break
            after -= 1
        kept.append(after)
        here = after
    return chain[kept]

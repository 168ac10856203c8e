"""Gaps between solids that stand still, and the share of a flow that a grid lets through them."""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from hybridmpm.scene.obstacles import Obstacle
from hybridmpm.scene.scene import Scene
from hybridmpm.scene.walls import Walls

_EVALUATIONS = 1_000_000
"""Largest number of signed distances that a search takes, points times solids: it bounds its time."""
_FINEST = 0.5
"""Distance of the points of a search, in cells of the scene, where there are not too many."""
_TOUCHING = 1.5
"""Solids nearer than this many distances of the points count as touching."""
_LOST, _LOST_SAND = 1.3, 3.0
"""Cells of an opening through which nothing flows; those of sand on the scene's own grid (Beverloo)."""
_KEPT, _KEPT_SAND = (0.45, 3e-4), (0.5, 1e-3)
"""The same with `transfer_loss`: cells at no loss, and more of them [s] for each 1/s at 128 cells/m."""
_WIDER = 1.5
"""A part of the room is at least this many times as wide as a gap that leads into it."""
_CORNER = 0.02
"""Share of the room up to which a part is a corner that does not matter [-]."""
_EQUAL = 1.05
"""Ratio of widths up to which two parts are one."""
_AROUND = 3.0
"""Radius about the middle of an opening that belongs to it, in distances from its solids."""
_Floats = npt.NDArray[np.float64]
_Whole = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Gap:
    """The narrowest place between two solids."""

    between: tuple[str, str]
    """Paths of the obstacles, or names of the walls."""
    width: float
    """Width [m]."""
    place: tuple[float, ...]
    """Point in it (D,) [m]."""
    transfer_loss: float | None = None
    """That of the scene [1/s]."""

    @property
    def at_wall(self) -> bool:
        """Whether a wall is one of the solids."""
        return any("wall" in name for name in self.between)

    def clear(self, resolution: int) -> float:
        """Return the width [m] through which something flows on a grid of `resolution` cells per metre."""
        lost = lost_cells(self.transfer_loss, resolution)
        return max(0.0, self.width - lost / resolution * (0.5 if self.at_wall else 1.0))

    def flow(self, resolution: int, *, is_sand: bool = False) -> float:
        """Return the share of a flow [-] that a grid of `resolution` cells per metre lets through.

        As if some cells were missing: the nodes next to the solids on both sides take part in their contact.
        """
        lost = lost_cells(self.transfer_loss, resolution, is_sand=is_sand)
        return max(0.0, 1.0 - lost / (self.width * resolution))


def lost_cells(transfer_loss: float | None, resolution: int, *, is_sand: bool = False) -> float:
    """Return the number of cells of an opening through which nothing flows, at a loss of transfers [1/s]."""
    most, (least, each) = (_LOST_SAND, _KEPT_SAND) if is_sand else (_LOST, _KEPT)
    return most if transfer_loss is None else min(most, least + each * transfer_loss * 128 / resolution)


def wide_enough(share: float, resolution: int, finer: int | None = None, *, lost: float = _LOST) -> float:
    """Return the width [m] at which a grid lets through `share` of what a finer one does, or of all."""
    return lost / (1 - share) * (1 / resolution - (share / finer if finer else 0.0))


def narrow_gaps(scene: Scene) -> tuple[Gap, ...]:
    """Return the gaps between solids that stand still which lead from one part of the room to another.

    The clearance of free points of a lattice is their distance to the nearest solid. Each point belongs to
    the part around the peak of clearance that is uphill of it, and a gap is where two parts meet between the
    same two solids. It counts where both parts are wider and no mere corners, and where no wider way leads
    round it that rises no higher. Gaps below 1.5 distances of the lattice are not seen; these are half a cell
    of the scene or, where there are many obstacles, more.
    """
    found = _gaps(scene.walls, scene.obstacles, scene.gravity, scene.dx)
    return tuple(replace(gap, transfer_loss=scene.transfer_loss) for gap in found)


@lru_cache(maxsize=64)
def _gaps(
    walls: Walls, obstacles: tuple[Obstacle, ...], gravity: tuple[float, ...], dx: float
) -> tuple[Gap, ...]:
    still = [(f"obstacles[{i}]", one.to_native()) for i, one in enumerate(obstacles) if not one.motion]
    if not still:
        return ()
    lower, upper, dim = np.array(walls.lower), np.array(walls.upper), len(gravity)
    names = [name for name, _ in still]
    names += [f"the {end} wall along {'xyz'[a]}" for a in range(dim) for end in ("lower", "upper")]
    volume = float(np.prod(upper - lower))
    step = max(_FINEST * dx, (volume * len(names) / _EVALUATIONS) ** (1 / dim))
    axes = [np.arange(a + step / 2, b, step) for a, b in zip(lower, upper, strict=True)]
    shape = tuple(len(axis) for axis in axes)
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    points = x.astype(np.float32)
    distances = itertools.chain(
        (np.float64(solid.signed_distance(points)) for _, solid in still),
        (d for a in range(dim) for d in (x[:, a] - lower[a], upper[a] - x[:, a])),
    )
    first, second, pair = _two_nearest(distances, len(x), len(names))
    part, ones, others = _parts(first.reshape(shape))
    peaks = np.zeros(len(x))
    np.maximum.at(peaks, part, first)
    low, high = np.sort([part[ones], part[others]], axis=0)
    lowest = np.where(first[ones] < first[others], ones, others)
    height = -(x @ np.array(gravity))
    found: dict[int, Gap] = {}
    for key in np.unique(low * len(x) + high).tolist():
        meeting, sides = lowest[low * len(x) + high == key], (key // len(x), key % len(x))
        for point in _openings(meeting[_WIDER * first[meeting] < peaks[[*sides]].min()], x, first):
            # Parts may meet beside the narrowest place.
            around = np.flatnonzero((pair == pair[point]) & (first > 0))
            around = around[np.linalg.norm(x[around] - x[point], axis=1) < _AROUND * first[point]]
            solids, width = int(pair[point]), float((first + second)[around].min())
            is_gap = width > _TOUCHING * step and solids // len(names) < len(still)
            wide = first >= _WIDER * first[point]
            starts = [_nearest(x, np.flatnonzero(wide & (part == side)), point) for side in sides]
            wide &= height <= height[starts].max() + first[point] * np.linalg.norm(gravity)
            known = found.get(solids)
            if is_gap and not (known and known.width <= width) and not _leads(wide.reshape(shape), *starts):
                between = (names[solids // len(names)], names[solids % len(names)])
                found[solids] = Gap(between, width, tuple(x[point].tolist()))
    return tuple(sorted(found.values(), key=lambda gap: gap.width))


def _nearest(x: _Floats, some: _Whole, point: int) -> int:
    return int(some[np.argmin(((x[some] - x[point]) ** 2).sum(axis=1))])


def _leads(free: npt.NDArray[np.bool_], start: int, end: int) -> bool:
    """Return whether a way of neighbouring free points leads from one to the other."""
    padded = np.pad(free, 1)
    place = [
        np.ravel_multi_index(np.add(np.unravel_index(one, free.shape), 1), padded.shape)
        for one in (start, end)
    ]
    steps = np.array(
        [side * int(np.prod(padded.shape[axis + 1 :])) for axis in range(free.ndim) for side in (1, -1)]
    )
    left, front = padded.ravel(), np.array(place[:1])
    while len(front) and left[place[1]]:
        left[front] = False
        near = np.unique((front[:, None] + steps).ravel())
        front = near[left[near]]
    return not left[place[1]]


def _openings(meeting: _Whole, x: _Floats, clearance: _Floats) -> Iterator[int]:
    """Yield the middle of each opening between two parts: a point where they meet, the farthest from solids.

    Where an opening ends at a third solid, its corner is no opening of its own.
    """
    left = meeting[np.argsort(-clearance[meeting], kind="stable")]
    while len(left):
        middle = left[0]
        reach = _AROUND * clearance[middle]
        around = meeting[np.linalg.norm(x[meeting] - x[middle], axis=1) < reach]
        if clearance[around].max() <= clearance[middle]:
            yield int(middle)
        left = left[np.linalg.norm(x[left] - x[middle], axis=1) >= reach]


def _two_nearest(distances: Iterable[_Floats], points: int, solids: int) -> tuple[_Floats, _Floats, _Whole]:
    """Return the distances to the nearest two of the solids, and one number for the pair."""
    first, second = np.full(points, np.inf), np.full(points, np.inf)
    one, two = np.zeros(points, np.int64), np.zeros(points, np.int64)
    for index, distance in enumerate(distances):
        nearest, nearer = distance < first, distance < second
        second = np.where(nearest, first, np.where(nearer, distance, second))
        two = np.where(nearest, one, np.where(nearer, index, two))
        first, one = np.where(nearest, distance, first), np.where(nearest, index, one)
    return first, second, np.minimum(one, two) * solids + np.maximum(one, two)


def _parts(clearance: _Floats) -> tuple[_Whole, _Whole, _Whole]:
    """Return the part (n,) of each point by the number of its peak, and the pairs of points where parts meet.

    Small parts, and those of equal width, are joined to a neighbour that they meet at nearly their own width.
    """
    flat, index = clearance.ravel(), np.arange(clearance.size).reshape(clearance.shape)
    best, uphill = flat.copy(), index.ravel().copy()
    sides: list[tuple[_Whole, _Whole]] = []
    for axis in range(clearance.ndim):
        a = np.take(index, range(clearance.shape[axis] - 1), axis).ravel()
        b = np.take(index, range(1, clearance.shape[axis]), axis).ravel()
        sides.append((a, b))
        for here, there in ((a, b), (b, a)):
            rises = flat[there] > best[here]
            best[here[rises]], uphill[here[rises]] = flat[there[rises]], there[rises]
    while not np.array_equal(higher := uphill[uphill], uphill):
        uphill = higher
    ones, others = (np.concatenate(side) for side in zip(*sides, strict=True))
    meet = (flat[ones] > 0) & (flat[others] > 0) & (uphill[ones] != uphill[others])
    ones, others = ones[meet], others[meet]
    saddles = np.minimum(flat[ones], flat[others])
    order = np.argsort(-saddles, kind="stable")
    low, high = np.sort([uphill[ones[order]], uphill[others[order]]], axis=0)
    _, firsts = np.unique(low * flat.size + high, return_index=True)
    sizes = np.bincount(uphill[flat > 0], minlength=flat.size) / np.count_nonzero(flat > 0)
    owner: dict[int, int] = {}
    for edge in order[np.sort(firsts)].tolist():
        roots = (_root(owner, int(uphill[side[edge]])) for side in (ones, others))
        less, more = sorted(roots, key=lambda root: float(flat[root]))
        alike = sizes[less] < _CORNER or flat[more] < _EQUAL * flat[less]
        if less != more and alike and flat[less] <= _WIDER * saddles[edge]:
            owner[less] = more
            sizes[more] += sizes[less]
    last = np.arange(flat.size)
    for one in owner:
        last[one] = _root(owner, one)
    part = last[uphill]
    apart = (part[ones] != part[others]) & (np.minimum(sizes[part[ones]], sizes[part[others]]) > _CORNER)
    return part, ones[apart], others[apart]


def _root(owner: dict[int, int], one: int) -> int:
    while one in owner:
        one = owner[one]
    return one

"""Parts of a drawing that overlap: the closed lines around what is seen of them."""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene.fields import Points
from hybridmpm.scene.lines import simplified

_COARSE, _FINE = 400, 1600
"""Cells along the longer side of a drawing: to find overlaps, and to trace what is seen."""
_SOME = 0.005
"""Part of the area of the smaller of two parts from which on they overlap, and of a part that may be lost."""

_MOST_PARTS, _MOST_PAIRS, _MOST_LINES = 500, 2000, 200
"""Parts, pairs of parts that may overlap, and lines around them: a polygon has 1000 corners."""

_NEAR = 4.0
"""Cells within which a traced corner is one of the drawing's."""

_Layer = tuple[bool, list[list[int]]]
"""Whether parts that are drawn one after another are white, and their groups."""
_Mask = npt.NDArray[np.bool_]


class Part(NamedTuple):
    """What an element of a drawing draws."""

    lines: Sequence[Points]
    """Closed lines (K, 2)."""
    is_nonzero: bool
    """Whether its fill rule is nonzero, else even-odd."""
    is_white: bool
    """Whether it hides what is below it, as paper does."""


def as_seen(parts: Sequence[Part]) -> list[Points]:
    """Return the closed lines (K, 2) around what is seen of the parts of a drawing.

    Parts that overlap are one; a part within another one is a hole, and what is white hides what was drawn
    before, unless all is white. Where the even-odd rule says the same, the lines are those that are given,
    else they are traced to a part in 1600 of the size.

    Raises
    ------
    ConfigError
        contourpy is not installed.
    DataError
        There are too many parts.
    """
    if any(not part.is_white for part in parts):
        # Paper at the bottom is not seen.
        parts = list(itertools.dropwhile(lambda part: part.is_white, parts))
    else:
        parts = [part._replace(is_white=False) for part in parts]
    if len(parts) > _MOST_PARTS:
        text = f"the drawing has {len(parts)} parts, at most {_MOST_PARTS} are allowed"
        raise DataError(f"{text}; leave some out, or take it in parts")
    lines = [line for part in parts for line in part.lines]
    points = np.concatenate(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    raster = _Raster(low, (high - low).max() / _COARSE, high)
    layers: list[_Layer] = []
    for is_white, run in itertools.groupby(range(len(parts)), lambda part: parts[part].is_white):
        members = list(run)
        layers.append((is_white, [members] if is_white else _grouped(raster, parts, members)))
    seen, simple = raster.seen(parts, layers), raster.filled(lines, nonzero=False)
    if np.count_nonzero(seen != simple) <= _SOME * np.count_nonzero(seen):
        return lines
    fine = _Raster(low, (high - low).max() / _FINE, high)
    traced = fine.traced(fine.seen(parts, layers))
    if len(traced) > _MOST_LINES:
        text = f"the drawing has {len(traced)} outlines, at most {_MOST_LINES} are allowed"
        raise DataError(f"{text}; leave some out, or take it in parts")
    snapped = [_snapped(line, points, _NEAR * fine.side) for line in traced]
    return [line for line in snapped if len(line) > 2]


def _snapped(line: Points, points: Points, reach: float) -> Points:
    """Return a line (K, 2) whose corners are those of the drawing where one is near: cells blunt tips."""
    found: list[Points] = []
    for corner in line:
        away = np.hypot(*(points - corner).T)
        nearest = int(away.argmin())
        place = points[nearest] if away[nearest] < reach else corner
        if not found or (place != found[-1]).any():
            found.append(place)
    return np.array(found)


def _grouped(raster: "_Raster", parts: Sequence[Part], members: list[int]) -> list[list[int]]:
    """Return the groups of some parts that overlap without one being within the other."""
    corners = [np.concatenate(parts[member].lines) for member in members]
    low = np.array([points.min(axis=0) for points in corners])
    high = np.array([points.max(axis=0) for points in corners])
    beside = ((low[:, None] < high) & (high[:, None] > low)).all(axis=-1)
    pairs = np.argwhere(np.triu(beside, 1))
    if len(pairs) > _MOST_PAIRS:
        raise DataError(f"{len(parts)} parts overlap in too many ways; unite them in the drawing program")
    masks = {one: raster.drawn(parts[members[one]]) for one in np.unique(pairs).tolist()}
    areas = {one: np.count_nonzero(mask) for one, mask in masks.items()}
    group = list(range(len(members)))
    for one, other in pairs.tolist():
        both, small = np.count_nonzero(masks[one] & masks[other]), min(areas[one], areas[other])
        is_within = both >= (1 - _SOME) * small and small < (1 - _SOME) * max(areas[one], areas[other])
        if both > _SOME * small and not is_within:
            old, new = group[other], group[one]
            group = [new if number == old else number for number in group]
    return [[members[k] for k, number in enumerate(group) if number == first] for first in sorted(set(group))]


class _Raster:
    """Square cells over a drawing, and which of them have their middle inside of lines."""

    def __init__(self, low: Points, side: float, high: Points) -> None:
        self._low, self.side = low, side
        self._counts = np.ceil((high - low) / side).astype(np.int64) + 1

    def filled(self, lines: Sequence[Points], *, nonzero: bool) -> _Mask:
        """Return the cells (X, Y) inside closed lines (K, 2), by the rule nonzero or even-odd."""
        start = np.concatenate(lines)
        end = np.concatenate([np.roll(line, -1, axis=0) for line in lines])
        lower, upper = np.minimum(start[:, 0], end[:, 0]), np.maximum(start[:, 0], end[:, 0])
        first, last = (self._beyond(x, 0) for x in (lower, upper))
        rows = last - first
        edge = np.repeat(np.arange(len(rows)), rows)
        row = np.arange(len(edge)) - np.repeat(np.cumsum(rows) - rows, rows) + first[edge]
        (ax, ay), (bx, by) = start[edge].T, end[edge].T
        x = self._low[0] + (row + 0.5) * self.side
        column = self._beyond(ay + (x - ax) * (by - ay) / (bx - ax), 1)
        turns = np.zeros(self._counts + np.array([0, 1]), dtype=np.int64)
        np.add.at(turns, (row, column), np.where(ax < bx, 1, -1))
        winding = np.cumsum(turns, axis=1)[:, :-1]
        return np.asarray(winding != 0 if nonzero else winding % 2 == 1)

    def drawn(self, part: Part) -> _Mask:
        """Return the cells (X, Y) of a part."""
        return self.filled(part.lines, nonzero=part.is_nonzero)

    def seen(self, parts: Sequence[Part], layers: Sequence[_Layer]) -> _Mask:
        """Return the cells (X, Y) that are seen: of a layer those of an odd number of its groups."""
        seen = np.zeros(self._counts, dtype=bool)
        for is_white, groups in layers:
            layer = np.zeros_like(seen)
            for group in groups:
                united = np.zeros_like(seen)
                for part in group:
                    united |= self.drawn(parts[part])
                layer ^= united
            seen = seen & ~layer if is_white else seen | layer
        return seen

    def _beyond(self, x: Points, axis: int) -> npt.NDArray[np.int64]:
        """Return the first cells along an axis whose middle is beyond places."""
        cell = np.ceil((x - self._low[axis]) / self.side - 0.5)
        return np.asarray(np.clip(cell, 0, self._counts[axis]).astype(np.int64))

    def traced(self, mask: _Mask) -> list[Points]:
        """Return the closed lines (K, 2) around cells (X, Y)."""
        try:
            import contourpy  # noqa: PLC0415 - an extra
        except ImportError:
            text = "parts of a drawing that overlap need contourpy"
            raise ConfigError(f"{text}: pip install 'hybridmpm[shapes]'") from None
        generator: Any = contourpy.contour_generator(z=np.pad(mask.astype(np.float64).T, 1))
        found = []
        for line in generator.lines(0.5):
            # Steps of cells along a slant are no corners.
            kept = simplified(line, 1.2)[:-1]
            if len(kept) > 2:
                found.append(self._low + (line[kept] - 0.5) * self.side)
        return found

"""The line of an arrow: the shortest way through its ink, moved to the middle of the ink, with its width.

Lengths are in pixels of the 512-pixel raster.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from hybridmpm.control.sketch.picture.ink import Levels, Mask, coverage_at, geodesic_levels
from hybridmpm.control.sketch.polyline import arc_lengths, evenly_spaced, values_at_knots
from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.errors import SketchError

MAX_WAY = 2048
"""Longest line that is read; it bounds the time that a maze or a spiral takes."""
_SPACING = 2.0
"""Distance between points of the line."""
_SMOOTHED = 9
"""Number of points of the shortest way that are averaged; it runs along pixels."""
_HALF_SECTION = 24.0
"""Half length of the sections across the line, on which its middle and its width are measured."""
_STEP = 0.5
"""Distance between the samples of a section."""
_INK = 0.2
"""Least coverage of the samples of a section that belong to the line."""
STEEPEST = 0.25
"""Largest change of a line's width over its length [-]; a head's is larger."""
_BROAD = 1.5
"""Width of the ink, over that of the line alone, from which there is more than the line."""
_CENTERED = 3
"""Number of times that the line is moved to the middle of its ink."""
_COMING = 24.0
"""Length of line that tells how its width changes where it goes on."""
_BLOCK = 32
"""Number of points of the line whose distances to all ink are held at a time."""


@dataclass(frozen=True)
class Shaft:
    """Points along the middle of a line, and its width there."""

    points: Floats
    """Points (K, 2), `spacing` apart."""
    widths: Floats
    """Measured widths (K,); 0 where there is no ink."""
    free: Floats
    """Widths (K,) of the line alone where its head makes the ink wider."""
    spacing: float

    @property
    def width(self) -> float:
        """Median width."""
        return float(np.median(self.free))

    @property
    def length(self) -> float:
        """Length of the line."""
        return (len(self.points) - 1) * self.spacing

    def reversed(self) -> "Shaft":
        """Return the line from its other end."""
        return replace(self, points=self.points[::-1], widths=self.widths[::-1], free=self.free[::-1])

    def before(self, center: Floats, radius: float) -> "Shaft":
        """Return the line up to where it enters a disc for the last time."""
        away = np.hypot(*(self.points - center).T)
        outside = np.flatnonzero(away[: int(away.argmin()) + 1] > radius)
        last = int(outside[-1]) + 1 if outside.size else 1
        widths = self.widths[:last]
        return replace(
            self, points=self.points[:last], widths=widths, free=_free_widths(widths, self.spacing)
        )

    def alone(self) -> "Shaft":
        """Return the line up to its last point whose ink is not clearly wider than the line.

        The way through the ink of a head begins with its back, beside the line.
        """
        wide = self.widths >= _BROAD * self.free + 1.0
        last = max(len(wide) - int(np.argmin(wide[::-1])), 1)
        return replace(self, points=self.points[:last], widths=self.widths[:last], free=self.free[:last])

    def tapered(self, free: "Shaft") -> "Shaft":
        """Return the line with other `free` widths behind its first part `free`, if that grows thinner.

        They change as they do over the last `_COMING` of that part, and are nowhere larger than before.
        """
        count = len(free.points)
        last = free.free[-(int(_COMING / self.spacing) + 2) :]
        places = np.arange(len(last), dtype=np.float64)
        start, end = values_at_knots(places, last, places[[0, -1]])
        if end >= start:
            return self
        onwards = end + (end - start) / places[-1] * np.arange(1, len(self.points) - count + 1)
        behind = np.minimum(self.free[count:], np.maximum(onwards, 1.0))
        return replace(self, free=np.concatenate([self.free[:count], behind]))

    def distance(self, points: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
        """Return the distance (N,) of points (N, 2) to the nearest point of the line, and its index (N,)."""
        square = np.full(len(points), np.inf)
        nearest = np.zeros(len(points), dtype=np.intp)
        x, y = points[:, :1], points[:, 1:]
        for first in range(0, len(self.points), _BLOCK):
            block = self.points[first : first + _BLOCK]
            away = (x - block[:, 0]) ** 2 + (y - block[:, 1]) ** 2
            index = away.argmin(axis=1)
            least = away[np.arange(len(points)), index]
            closer = least < square
            square[closer], nearest[closer] = least[closer], first + index[closer]
        return np.sqrt(square), nearest


def find_shaft(coverage: Floats, mask: Mask) -> Shaft:
    """Return the line between the two ends of a mark that lie farthest apart, as the ink goes.

    Parameters
    ----------
    coverage : float (512, 512)
        Part of each pixel that is ink.
    mask : bool (512, 512)
        Connected pixels, the ink among them.

    Raises
    ------
    SketchError
        The line is longer than `MAX_WAY`.
    """
    points = _way_through(mask)
    for _ in range(_CENTERED):
        points, spacing = _even(_averaged(points, 3))
        offsets, widths = _sections(coverage, points)
        # Among the barbs of a head the middle of the ink says nothing.
        alone = widths < _BROAD * _free_widths(widths, spacing) + 1.0
        points = points + np.where(alone[:, None], offsets, 0.0)
    points, spacing = _even(points)
    _, widths = _sections(coverage, points)
    return Shaft(points, widths, _free_widths(widths, spacing), spacing)


def connected(sections: Floats) -> Floats:
    """Return the coverage (K, M) of sections, 0 beyond the first gap on each side of their middle."""
    middle = sections.shape[1] // 2
    solid = sections > _INK
    right = np.logical_and.accumulate(solid[:, middle:], axis=1)
    left = np.logical_and.accumulate(solid[:, middle::-1], axis=1)[:, ::-1]
    return np.asarray(sections * np.concatenate([left[:, :-1], right], axis=1))


def _way_through(mask: Mask) -> Floats:
    """Return the shortest way (K, 2) between two ends of a mask, averaged over a few pixels."""
    rows, columns = np.nonzero(mask)
    first = _farthest(geodesic_levels(mask, (int(rows[0]), int(columns[0])), MAX_WAY))
    levels = geodesic_levels(mask, first, MAX_WAY)
    row, column = _farthest(levels)
    if levels[row, column] == MAX_WAY:
        raise SketchError(
            f"the line is too long: an arrow may be up to {MAX_WAY} pixels (of 512) long along its way"
        )
    padded = np.pad(np.where(levels < 0, levels.size, levels), 1, constant_values=levels.size)
    way = [(column + 0.5, row + 0.5)]
    while levels[row, column] > 0:
        window = padded[row : row + 3, column : column + 3]
        down, right = divmod(int(window.argmin()), 3)
        row, column = row + down - 1, column + right - 1
        way.append((column + 0.5, row + 0.5))
    return _averaged(np.array(way), _SMOOTHED)


def _farthest(levels: Levels) -> tuple[int, int]:
    row, column = np.unravel_index(int(levels.argmax()), levels.shape)
    return int(row), int(column)


def _averaged(points: Floats, count: int) -> Floats:
    """Return the running means over `count` points; the ends stay where they are."""
    half = min(count // 2, (len(points) - 1) // 2)
    if half == 0:
        return points
    # Mirrored at its ends, a line keeps them.
    before = 2 * points[0] - points[half:0:-1]
    after = 2 * points[-1] - points[-2 : -half - 2 : -1]
    longer = np.vstack([before, points, after])
    total = np.cumsum(np.vstack([np.zeros(2), longer]), axis=0)
    return np.asarray((total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1))


def _even(points: Floats) -> tuple[Floats, float]:
    length = float(arc_lengths(points)[-1])
    count = max(int(length / _SPACING), 4)
    return evenly_spaced(points, count), length / (count - 1)


def _sections(coverage: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return how far (K, 2) the middle of the ink is from points of a line (K, 2), and its width (K,)."""
    padded = np.vstack([points[:1], points[:1], points, points[-1:], points[-1:]])
    along = padded[4:] - padded[:-4]
    along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    aside = np.arange(-_HALF_SECTION, _HALF_SECTION + _STEP, _STEP)
    ink = connected(coverage_at(coverage, points[:, None] + aside[:, None] * across[:, None]))
    amount = ink.sum(axis=1)
    middle = ink @ aside / np.maximum(amount, 1e-9)
    return middle[:, None] * across, amount * _STEP


def _free_widths(widths: Floats, spacing: float) -> Floats:
    """Return the widths (K,) of the line without its head.

    They are as wide as measured, but nowhere wider than a gentle slope from any other place allows. Ends of
    the line and of its pieces are round, so the widths next to them say nothing.
    """
    typical = float(np.median(widths[widths > 0])) if (widths > 0).any() else 1.0
    near = int(0.6 * typical / spacing) + 1
    inked = np.pad(widths > 0, near)
    clear = np.lib.stride_tricks.sliding_window_view(inked, 2 * near + 1).all(axis=1)
    if not clear.any():
        return np.full(len(widths), typical)
    places = np.arange(len(widths), dtype=np.float64) * spacing
    slopes = STEEPEST * np.abs(places[clear, None] - places[clear])
    return np.asarray(np.interp(places, places[clear], (widths[clear] + slopes).min(axis=1)))

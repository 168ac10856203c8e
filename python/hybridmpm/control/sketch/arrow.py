"""Reading an arrow from its ink: its tail, its way to the tip, and its width."""

from dataclasses import dataclass

import numpy as np

from hybridmpm.control.sketch.ink import Levels, Mask, geodesic_levels, half_width, pixels_of
from hybridmpm.control.sketch.sketch import RASTER_SIZE, WIDTH_AT_BACK, WIDTH_AT_FRONT, Arrow, Floats
from hybridmpm.errors import SketchError

_BAND = 6
"""Number of geodesic steps that are averaged into one point of the centre line."""
_HEAD_REACH = 34.0
"""Distance from the tip [pixels] within which the head lies, in addition to the width of the stroke.

On a short arrow the head lies within half of the distance between the ends.
"""
_FREE_SHAFT = (0.3, 0.65)
"""Part of the stroke, as fractions of its length, that a head at neither end can cover.

The widths measured here are extrapolated to both ends.
"""
_CLEAR_HEAD = 24
"""Smallest difference of ink beside the stroke [pixels] between both ends; with less, no end is the head."""
_EDGE = 2.5
"""Distance from the fitted edge of the stroke [pixels] up to which ink counts as an unsteady stroke."""
_TOLERANCE = 1.5
"""Largest distance between the simplified polyline and the centre line [pixels]."""


@dataclass(frozen=True)
class _Shaft:
    """Centre line of a stroke from one end to the other, and its width as a linear function of the steps."""

    levels: Levels
    """Geodesic steps from the start to each pixel of ink, int32 (512, 512); -1 outside the ink."""
    centers: Floats
    """Points (K, 2) of the centre line [pixels]."""
    steps: Floats
    """Geodesic steps (K,) from the start to each point of the centre line."""
    slope: float
    """Change of the width with each step [pixels]."""
    width_at_start: float
    """Width at the start [pixels]."""

    def width(self, step: float) -> float:
        """Return the width [pixels] so many geodesic steps from the start, at least 1."""
        return max(self.width_at_start + self.slope * step, 1.0)


def stroke_ends(mark: Mask) -> tuple[Floats, Floats, int]:
    """Return both ends (x, y) of a stroke [pixels] and the number of geodesic steps between them."""
    rows, columns = np.nonzero(mark)
    somewhere = geodesic_levels(mark, (int(rows[0]), int(columns[0])))
    first = _farthest(somewhere)
    levels = geodesic_levels(mark, first)
    second = _farthest(levels)
    return _middle(first), _middle(second), int(levels[second])


def read_arrow(mark: Mask) -> Arrow:
    """Return the arrow that a connected mark of ink shows, with a width for each point.

    The head is the end with more ink beside the stroke. The stroke near an end is taken to have the width
    that is extrapolated from its free part. Ends are taken to be round, so that the ink reaches half a width
    beyond the arrow's first and last point.

    Raises
    ------
    SketchError
        The arrow is too short, or its head cannot be told from its tail.
    """
    first, second, _ = stroke_ends(mark)
    ink = pixels_of(mark)
    forward, backward = (
        _Approach.to(mark, ink, start, end) for start, end in ((first, second), (second, first))
    )
    if abs(forward.beside - backward.beside) < _CLEAR_HEAD:
        raise SketchError("the arrow's head cannot be told from its tail: draw a clear head at the tip")
    head = forward if forward.beside > backward.beside else backward
    tip = _tip(mark, head)
    tail = _tail(mark, ink, head)
    inner = head.free[np.linalg.norm(head.free - tail, axis=1) > _BAND]
    line = _simplified(np.vstack([tail, inner, tip]))
    return _to_arrow(line, head.shaft)


@dataclass(frozen=True)
class _Approach:
    """A stroke followed from `start` to its other end, and the ink around that end."""

    start: Floats
    shaft: _Shaft
    free: Floats
    """Points (K, 2) of the centre line before the neighbourhood of the end [pixels]."""
    near: Floats
    """Pixels of ink (M, 2) in the neighbourhood of the end."""
    beside: int
    """Number of pixels among `near` that lie outside the stroke continued to the end."""

    @classmethod
    def to(cls, mark: Mask, ink: Floats, start: Floats, end: Floats) -> "_Approach":
        shaft = _measure(mark, _pixel(start))
        span = float(np.linalg.norm(end - start))
        width = shaft.width(float(shaft.steps[-1]))
        reach = min(_HEAD_REACH + width, 0.5 * span)
        free = shaft.centers[np.linalg.norm(shaft.centers - end, axis=1) > reach]
        if len(free) < 3:
            raise SketchError("the arrow is too short to show a direction: draw it at least 50 pixels long")
        near = ink[np.linalg.norm(ink - end, axis=1) <= reach]
        line = shaft.centers[np.linalg.norm(shaft.centers - end, axis=1) <= reach + 2 * _BAND]
        aside = _distance_to_polyline(near, line)
        return cls(start, shaft, free, near, int((aside > width / 2 + _EDGE).sum()))


def _measure(mark: Mask, start: tuple[int, int]) -> _Shaft:
    levels = geodesic_levels(mark, start)
    ink = pixels_of(mark)
    band = levels[mark] // _BAND
    counts = np.bincount(band)
    sums = [np.bincount(band, weights=ink[:, axis]) for axis in (0, 1)]
    centers = np.asarray(np.column_stack(sums) / counts[:, None], dtype=np.float64)
    steps = (np.arange(len(counts), dtype=np.float64) + 0.5) * _BAND
    low, high = (fraction * float(levels.max()) for fraction in _FREE_SHAFT)
    clear = (steps >= low) & (steps <= high)
    if clear.sum() < 2:
        clear = np.ones(len(steps), dtype=bool)
    widths = np.array([2 * half_width(mark, center) for center in centers[clear]])
    # In a sharp bend the centre line leaves the ink, and the width there is 0.
    inside = widths > 0
    slope, at_start = np.polyfit(steps[clear][inside], widths[inside], 1) if inside.sum() > 1 else (0.0, 1.0)
    return _Shaft(levels, centers, steps, float(slope), float(at_start))


def _tip(mark: Mask, head: _Approach) -> Floats:
    """Return the foremost point of the head in the direction of the shaft.

    The end of the stroke would be wrong: on an open head it is the end of a barb, which lies behind the tip.
    """
    behind = head.free[max(len(head.free) - 6, 0)]
    along = _unit(head.free[-1] - behind)
    for _ in range(3):
        front = _foremost(head.near, along)
        along = _unit(front - behind)
    return front - _cap_radius(mark, front, along) * along


def _tail(mark: Mask, ink: Floats, head: _Approach) -> Floats:
    near = ink[np.linalg.norm(ink - head.start, axis=1) <= 2 * WIDTH_AT_FRONT]
    inner = head.free[min(4, len(head.free) - 1)]
    along = _unit(head.start - inner)
    for _ in range(3):
        front = _foremost(near, along)
        along = _unit(front - inner)
    return front - _cap_radius(mark, front, along) * along


def _distance_to_polyline(points: Floats, line: Floats) -> Floats:
    """Return the distances (N,) of points (N, 2) from a polyline, which is sampled densely."""
    places = np.linspace(0, len(line) - 1, 4 * len(line))
    dense = np.column_stack([np.interp(places, np.arange(len(line)), line[:, axis]) for axis in (0, 1)])
    return np.asarray(np.linalg.norm(points[:, None] - dense, axis=2).min(axis=1))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.hypot(*vector)), 1e-9))


def _foremost(points: Floats, along: Floats) -> Floats:
    """Return the mean of the points that lie farthest in a direction."""
    progress = points @ along
    return np.asarray(points[progress >= progress.max() - 0.6].mean(axis=0))


def _cap_radius(mark: Mask, front: Floats, along: Floats) -> float:
    """Return the distance [pixels] from the foremost point of a round end back to the centre of its arc.

    At a depth s behind the foremost point, the largest disc inside a round end has the radius s; inside a
    pointed end the disc is smaller.
    """
    radius = 0.0
    for depth in np.arange(1.0, WIDTH_AT_FRONT / 2 + 1.5, 0.5):
        if half_width(mark, front - depth * along) < 0.8 * depth:
            break
        radius = float(depth)
    return radius


def _simplified(points: Floats) -> Floats:
    """Return the polyline without points that lie on the lines between others (Douglas and Peucker 1973)."""
    start, end = points[0], points[-1]
    if len(points) <= 2:
        return points
    along = end - start
    length = max(float(np.hypot(*along)), 1e-9)
    beside = points[1:-1] - start
    distance = np.abs(beside[:, 0] * along[1] - beside[:, 1] * along[0]) / length
    worst = int(distance.argmax())
    if distance[worst] <= _TOLERANCE:
        return np.vstack([start, end])
    return np.vstack([_simplified(points[: worst + 2])[:-1], _simplified(points[worst + 1 :])])


def _to_arrow(line: Floats, shaft: _Shaft) -> Arrow:
    rows, columns = np.nonzero(shaft.levels >= 0)
    widths = []
    for x, y in line:
        nearest = int(((columns + 0.5 - x) ** 2 + (rows + 0.5 - y) ** 2).argmin())
        step = float(shaft.levels[rows[nearest], columns[nearest]])
        widths.append(np.clip(shaft.width(step), WIDTH_AT_BACK, WIDTH_AT_FRONT))
    points = np.column_stack([line[:, 0], RASTER_SIZE - line[:, 1]]) / RASTER_SIZE
    return Arrow(np.clip(points, 0.0, 1.0), np.array(widths))


def _farthest(levels: Levels) -> tuple[int, int]:
    row, column = np.unravel_index(int(levels.argmax()), levels.shape)
    return int(row), int(column)


def _middle(pixel: tuple[int, int]) -> Floats:
    return np.array([pixel[1] + 0.5, pixel[0] + 0.5])


def _pixel(point: Floats) -> tuple[int, int]:
    return int(point[1]), int(point[0])

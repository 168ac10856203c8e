"""Reading an arrow from its ink: its tail, its way to the tip, and its width.

Lengths are in pixels of the 512-pixel raster, points are (x, y) with y down until the arrow is made.
"""

from dataclasses import dataclass

import numpy as np

from hybridmpm.control.sketch.picture.ink import Mask, coverage_at, pixels_of
from hybridmpm.control.sketch.picture.shaft import STEEPEST, Shaft, connected, find_shaft
from hybridmpm.control.sketch.polyline import arc_lengths, distance_to_line, simplified, values_at_knots
from hybridmpm.control.sketch.sketch import RASTER_SIZE, WIDTH_AT_BACK, WIDTH_AT_FRONT, Arrow, Floats
from hybridmpm.errors import SketchError

_BESIDE = 1.5
"""Distance from the edge of the line up to which ink counts as an unsteady line."""
_CLEAR_HEAD = 8.0
"""Least ink beside the line [pixels] at the end that is the head."""
_OTHER_END = 0.5
"""Largest ink beside the line at the tail, as a fraction of that at the head."""
_MIN_LENGTH = 40.0
"""Shortest arrow, from the end of its tail to that of its head."""
_TOO_SHORT = "the arrow is too short to show a direction: draw it at least 50 pixels (of 512) long"
_MIN_FREE = 12.0
"""Shortest line outside of the head that shows a direction."""
_LARGEST_HEAD = 0.45
"""Largest radius of a head, as a fraction of the arrow's length."""
_KNOTS = 30.0
"""Least length of line between two places at which the change of its width may turn."""
_UNSTEADY = 3.0
"""Distance from the edge of the arrow's line up to which ink belongs to it."""
_HEAD_OPENING = 1.2
"""Tangent of the largest angle between line and barbs."""
_LONGEST_HEAD = 0.6
"""Largest length of a head, as a fraction of the arrow's length."""
_MAX_STRAY = 0.1
"""Largest share of the ink that may lie neither on the line nor in the head."""
_OTHER_LINES = "the arrow has other lines beside it: draw one arrow, longer than its head, and nothing else"
_DIRECTION = 24.0
"""Length of line from which the direction of an end is taken."""
_TOLERANCE = 1.5
"""Largest distance between the arrow's polyline and the middle of its line."""


def read_arrow(coverage: Floats, mask: Mask) -> Arrow:
    """Return the arrow that one mark of ink shows, with a width for each point.

    The head is the end with more ink beside the line. The line near an end is taken to have the width that is
    extrapolated from its free part. Ends of the line are taken to be round.

    Parameters
    ----------
    coverage : float (512, 512)
        Part of each pixel that is ink.
    mask : bool (512, 512)
        Connected pixels that join all of the ink.

    Raises
    ------
    SketchError
        The arrow is too short, its head cannot be told from its tail, or there are lines beside it.
    """
    ink = pixels_of(coverage > 0)
    amount = coverage[coverage > 0]
    whole = find_shaft(coverage, mask)
    if whole.length < _MIN_LENGTH:
        raise SketchError(_TOO_SHORT)
    shaft, head = _pointed(whole, ink, amount)
    free = shaft.before(head.center, head.radius + shaft.width / 2 + 4.0)
    if free.length < _MIN_FREE:
        raise SketchError(_TOO_SHORT)
    tip = _tip(coverage, ink, free, head)
    tail, inner = _tail(ink, amount, free)
    line = np.vstack([tail, free.points[inner:], tip])
    kept = simplified(line, _TOLERANCE)
    widths = _widths_at(arc_lengths(line), free.widths[inner:], kept)
    if _stray(ink, amount, line[kept], widths) > _MAX_STRAY:
        raise SketchError(_OTHER_LINES)
    points = np.column_stack([line[kept, 0], RASTER_SIZE - line[kept, 1]]) / RASTER_SIZE
    return Arrow(np.clip(points, 0.0, 1.0), np.clip(widths, WIDTH_AT_BACK, WIDTH_AT_FRONT))


def _stray(ink: Floats, amount: Floats, line: Floats, widths: Floats) -> float:
    """Return the share of the ink that is neither on the line nor where the head may lie."""
    reach = float(widths.max()) / 2 + _UNSTEADY
    behind = line[-1] - ink
    along = _unit(line[-1] - line[-2])
    depth, aside = behind @ along, np.abs(behind @ np.array([-along[1], along[0]]))
    length = float(arc_lengths(line)[-1])
    in_head = (
        (depth > -reach) & (aside < depth * _HEAD_OPENING + 2 * reach) & (depth < _LONGEST_HEAD * length)
    )
    on_line = distance_to_line(ink, line) < reach
    return float(amount[~(in_head | on_line)].sum() / amount.sum())


def _widths_at(places: Floats, measured: Floats, kept: list[int]) -> Floats:
    """Return the widths at the points `kept` of a line, from those measured between its ends."""
    knots = [places[0]]
    for place in places[kept[1:-1]]:
        if place - knots[-1] >= _KNOTS and places[-2] - place >= _KNOTS:
            knots.append(place)
    knots.append(places[-1])
    clear = measured > 0
    values = values_at_knots(places[1:-1][clear], measured[clear], np.array(knots))
    return np.interp(places[kept], knots, values)


@dataclass(frozen=True)
class _Head:
    """Where the ink beside the line is."""

    center: Floats
    radius: float


def _pointed(shaft: Shaft, ink: Floats, amount: Floats) -> tuple[Shaft, _Head]:
    """Return the line turned so that its head is at the end, and the head."""
    distance, nearest = shaft.distance(ink)
    beside = distance > shaft.free[nearest] / 2 + _BESIDE
    at_end = nearest >= len(shaft.points) / 2
    start, end = (float(amount[beside & where].sum()) for where in (~at_end, at_end))
    if max(start, end) < _CLEAR_HEAD or min(start, end) > _OTHER_END * max(start, end):
        raise SketchError(
            "the arrow's head cannot be told from its tail: draw one arrow with a clear head at its tip alone"
        )
    if start > end:
        shaft, at_end = shaft.reversed(), ~at_end
    where = beside & at_end
    for _ in range(3):
        share = amount[where] / amount[where].sum()
        center = share @ ink[where]
        away = np.hypot(*(ink - center).T)
        # A line of ink reaches 1.73 times as far from its middle as in the root mean square.
        radius = 1.8 * float(np.sqrt(share @ away[where] ** 2)) + 1.0
        where = beside & (away < 1.5 * radius)
    if radius > _LARGEST_HEAD * shaft.length:
        raise SketchError(_OTHER_LINES)
    return shaft, _Head(center, radius)


def _tip(coverage: Floats, ink: Floats, free: Shaft, head: _Head) -> Floats:
    """Return the tip: the foremost point of the head in the direction of the line.

    The line's end would be wrong: on an open head it is the end of a barb, which lies behind the tip.
    """
    last = free.points[-1]
    back = free.points[max(len(free.points) - 1 - int(_DIRECTION / free.spacing), 0)]
    along = _unit(last - back)
    reach = float(np.hypot(*(head.center - last))) + 2.0 * head.radius + free.width
    solid = ink[coverage_at(coverage, ink) >= 0.5]
    near = solid[np.hypot(*(solid - last).T) < reach]
    for _ in range(3):
        progress = near @ along
        front = near[progress >= progress.max() - 0.6].mean(axis=0)
        along = _unit(front - last)
    return np.asarray(front + _beyond(coverage, front, along) * along)


def _beyond(coverage: Floats, front: Floats, along: Floats) -> float:
    """Return how far [pixels] the tip lies beyond the middle of the foremost pixel.

    This is negative where the foremost pixel is the edge of a round end. A depth d behind the foremost point
    of a disc of radius r, the section has half the width sqrt(2 r d - d^2); behind the point of a wedge
    it grows with d.
    """
    depths = np.arange(1.0, 6.5, 0.5)
    aside = np.arange(-24.0, 24.5, 0.5)
    across = np.array([-along[1], along[0]])
    sections = coverage_at(coverage, (front - depths[:, None] * along)[:, None] + aside[:, None] * across)
    halves = connected(sections).sum(axis=1) * 0.5 / 2
    # The pixel's own middle lies half a pixel behind its edge.
    radii = (halves**2 + (depths + 0.5) ** 2) / (2 * (depths + 0.5))
    early, late = radii[:2].mean(), radii[4:6].mean()
    if late > 1.7 * early:
        slope, start = np.polyfit(depths, halves, 1)
        return float(np.clip(start / max(slope, 0.1), 0.0, 3.0))
    return 0.5 - float(min(np.median(radii[:4]), 1.2 * WIDTH_AT_FRONT / 2))


def _tail(ink: Floats, amount: Floats, free: Shaft) -> tuple[Floats, int]:
    """Return the tail, and the index of the first point of the line that lies clearly inside of it.

    The ink behind a point of the line tells the length L from there to the tail. With the widths w there and
    w_0 at the tail, which is round, it is (w + w_0) L / 2 + pi w_0^2 / 8.
    """
    inner = min(int((free.free[0] + 6.0) / free.spacing), len(free.points) - 2)
    after = min(inner + max(int(_DIRECTION / free.spacing), 1), len(free.points) - 1)
    here = free.points[inner]
    widths = free.free[inner : after + 1]
    places = np.arange(len(widths), dtype=np.float64) * free.spacing
    width, farther = np.maximum(values_at_knots(places, widths, places[[0, -1]]), 1.0)
    slope = float(np.clip((farther - width) / places[-1], -STEEPEST, STEEPEST))
    near = np.hypot(*(ink - here).T) < 2.0 * width + 20.0
    ink, amount = ink[near], amount[near]
    backward = _unit(here - free.points[after])
    for _ in range(3):
        behind = (ink - here) @ backward > 0
        backward = _unit(amount[behind] @ ink[behind] / max(float(amount[behind].sum()), 1e-9) - here)
    area = float(amount[behind].sum())
    length = area / width
    for _ in range(5):
        at_tail = max(width - slope * length, 1.0)
        length = max((area - np.pi * at_tail**2 / 8) / ((width + at_tail) / 2), 0.0)
    return here + length * backward, inner


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.hypot(*vector)), 1e-9))

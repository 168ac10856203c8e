"""Reading an arrow from its ink: its tail, its way to the tip, and its width.

Lengths are in pixels of the 512-pixel raster, points are (x, y) with y down until the arrow is made.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from hybridmpm.control.sketch.picture.ink import Mask, coverage_at, pixels_of
from hybridmpm.control.sketch.picture.marks import MAX_GAP, labels
from hybridmpm.control.sketch.picture.shaft import STEEPEST, Shaft, connected, find_shaft
from hybridmpm.control.sketch.polyline import (
    arc_lengths,
    distance_to_line,
    evenly_spaced,
    simplified,
    values_at_knots,
)
from hybridmpm.control.sketch.sketch import RASTER_SIZE, WIDTH_AT_BACK, WIDTH_AT_FRONT, Arrow, Floats
from hybridmpm.errors import SketchError

_BESIDE = 1.5
"""Distance from the edge of the line up to which ink counts as an unsteady line."""
_LOOKS = 2
"""Number of times that the head is looked for."""
_NEAR_END = 0.4
"""Place along the line, from 0 to 1, from which ink beside it may be the head at its end."""
_CLEAR_HEAD = 8.0
"""Least ink beside the line [pixels] at the end that is the head."""
_NO_HEAD = "the arrow's head cannot be told from its tail: draw one arrow with a clear head at its tip alone"
_MIN_LENGTH = 40.0
"""Shortest arrow, from the end of its tail to that of its head."""
_SHORT = 100.0
"""Length from which an arrow has a free shaft, unless other lines hide it."""
_TOO_SHORT = "the arrow is too short to show a direction: draw it at least 50 pixels (of 512) long"
_MIN_FREE = 12.0
"""Shortest line outside of the head that shows a direction."""
_LARGEST_HEAD = 0.45
"""Largest radius of a head, as a fraction of the arrow's length."""
_SHARPEST = -0.87
"""Cosine of the sharpest turn of an arrow, 150 degrees; a way that turns back has followed a barb."""
_KNOTS = 30.0
"""Least length of line between two places at which the change of its width may turn."""
_PRESSURE = 1.5
"""How many times as far from the measured widths a steady change may be as one from point to point, and still
be preferred; pressure varies, too."""
_UNSTEADY = 3.0
"""Distance from the edge of the arrow's line up to which ink belongs to it."""
_HEAD_OPENING = 1.2
"""Tangent of the largest angle between line and barbs."""
_LONGEST_HEAD = 0.6
"""Largest length of a head, as a fraction of the arrow's length."""
_OTHER_HEAD = 0.5
"""Largest amount of ink that is neither line nor head, as a fraction of the head's; another head has more."""
_MAX_STRAY = 0.1
"""Largest share of the ink that may lie neither on the line nor in the head."""
_OTHER_LINES = "the arrow has other lines beside it: draw one arrow, longer than its head, and nothing else"
_POINTED = 1.6
"""Radius of a disc that fits a tip's sections a few pixels behind its front, over that of the foremost
ones, from which the tip is a point. Drawn points have 1.68 and more."""
_DIRECTION = 24.0
"""Length of line from which the direction of an end is taken."""
_TOLERANCE = 1.5
"""Largest distance between the arrow's polyline and the middle of its line."""


def read_arrow(coverage: Floats, mask: Mask) -> Arrow:
    """Return the arrow that one mark of ink shows, with a width for each point.

    The head is ink beside one end of the line; if both have such ink, it is the one that leaves the least
    ink unexplained. The line near an end is taken to have the width that is extrapolated from its free part.
    Ends of the line are taken to be round.

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
    ink = _Ink(coverage, pixels_of(coverage > 0), coverage[coverage > 0])
    shaft = find_shaft(coverage, mask)
    if shaft.length < _MIN_LENGTH:
        raise SketchError(_TOO_SHORT)
    distance, nearest = shaft.distance(ink.pixels)
    lines = (
        _Line(shaft, distance, nearest),
        _Line(shaft.reversed(), distance, len(shaft.points) - 1 - nearest),
    )
    heads = [_beside_end(ink, line) for line in lines]
    readings = [
        reading
        for line, head in zip(lines, heads, strict=True)
        if (reading := _read(ink, line, head)) is not None
    ]
    if not readings:
        raise SketchError(_NO_HEAD if shaft.length > _SHORT or not np.any(heads) else _TOO_SHORT)
    best = min(readings, key=lambda reading: reading.unexplained)
    if best.unexplained > _MAX_STRAY:
        raise SketchError(_OTHER_LINES)
    if sum(reading.unexplained <= _MAX_STRAY for reading in readings) > 1:
        raise SketchError(_NO_HEAD)
    points = np.column_stack([best.line[:, 0], RASTER_SIZE - best.line[:, 1]]) / RASTER_SIZE
    return Arrow(np.clip(points, 0.0, 1.0), np.clip(best.widths, WIDTH_AT_BACK, WIDTH_AT_FRONT))


@dataclass(frozen=True)
class _Ink:
    """All ink of a mark."""

    coverage: Floats
    """Part of each pixel that is ink, (512, 512)."""
    pixels: Floats
    """Middles (N, 2) of the pixels with ink."""
    amount: Floats
    """Coverage (N,) of these pixels."""


@dataclass(frozen=True)
class _Line:
    """A line through the ink, from what may be its tail to what may be its tip."""

    shaft: Shaft
    distance: Floats
    """Distance (N,) of each pixel of ink to the line."""
    nearest: npt.NDArray[np.intp]
    """Index (N,) of the point of the line that is nearest to the pixel."""


@dataclass(frozen=True)
class _Head:
    """Where the ink beside the line is."""

    center: Floats
    radius: float


@dataclass(frozen=True)
class _Reading:
    """An arrow whose head is at one of the two ends of the line."""

    line: Floats
    """Points (K, 2) from tail to tip."""
    widths: Floats
    """Widths (K,)."""
    unexplained: float
    """Share of the ink that is neither line nor head, plus the part of the line that has no ink."""


def _beside_end(ink: _Ink, line: _Line) -> npt.NDArray[np.bool_]:
    """Return which pixels (N,) of ink lie beside the line, nearer to its end than to its start.

    A connected piece of ink is in one place as a whole, because the barb of a large head may reach back
    beyond half of a short line.
    """
    beside = line.distance > line.shaft.free[line.nearest] / 2 + _BESIDE
    mask = np.zeros((RASTER_SIZE, RASTER_SIZE), dtype=bool)
    column, row = ink.pixels.astype(np.intp).T
    mask[row[beside], column[beside]] = True
    piece = labels(mask)[row, column]
    weight = np.where(beside, ink.amount, 0.0)
    total = np.bincount(piece, weight)
    place = np.bincount(piece, weight * line.nearest / (len(line.shaft.points) - 1))
    return np.asarray(beside & ((place / np.maximum(total, 1e-9))[piece] > _NEAR_END))


def _read(ink: _Ink, line: _Line, beside: npt.NDArray[np.bool_]) -> _Reading | None:
    """Return the arrow whose head is the ink `beside` the end of a line; None if that cannot be.

    Where the line is thin next to its head and thick elsewhere, its width within the head is bounded too
    loosely at first, and much of the head counts as line. So the head is looked for a second time, beside
    the line as it comes in.
    """
    reading = None
    for _ in range(_LOOKS):
        if ink.amount[beside].sum() < _CLEAR_HEAD:
            break
        head = _head(ink, beside)
        if head.radius > _LARGEST_HEAD * line.shaft.length:
            break
        free = line.shaft.before(head.center, head.radius + line.shaft.width / 2 + 4.0).alone()
        if free.length < _MIN_FREE:
            break
        reading = _reading(ink, free, beside, head) or reading
        beside = _beside_end(ink, replace(line, shaft=line.shaft.tapered(free)))
    return reading


def _reading(ink: _Ink, free: Shaft, beside: npt.NDArray[np.bool_], head: _Head) -> _Reading | None:
    """Return the arrow that is the `free` line and a head, the ink `beside`; None if that is none."""
    tip = _tip(ink, free, head)
    if not _spreads_backwards(ink, beside, tip, _unit(tip - free.points[-1])):
        return None
    tail, inner = _tail(ink, free)
    if not (free.widths[inner:] > 0).any():
        return None
    way = np.vstack([tail, free.points[inner:], tip])
    kept = simplified(way, _TOLERANCE)
    steps = np.diff(way[kept], axis=0)
    steps /= np.maximum(np.hypot(*steps.T), 1e-9)[:, None]
    if ((steps[:-1] * steps[1:]).sum(axis=1) < _SHARPEST).any():
        return None
    widths = _widths_at(arc_lengths(way), free.widths[inner:], kept)
    return _Reading(way[kept], widths, _unexplained(ink, way[kept], widths))


def _spreads_backwards(ink: _Ink, beside: npt.NDArray[np.bool_], tip: Floats, along: Floats) -> bool:
    """Return whether ink lies the farther beside the line, the farther it is behind the tip, as in a head."""
    behind, share = tip - ink.pixels[beside], ink.amount[beside] / ink.amount[beside].sum()
    depth, aside = behind @ along, np.abs(behind @ np.array([-along[1], along[0]]))
    return float(share @ ((depth - share @ depth) * (aside - share @ aside))) > 0


def _unexplained(ink: _Ink, line: Floats, widths: Floats) -> float:
    """Return the share of the ink that is neither line nor head, plus the part of the line that has no ink.

    Gaps that are bridged in an arrow have no ink.
    """
    reach = float(widths.max()) / 2 + _UNSTEADY
    behind = line[-1] - ink.pixels
    along = _unit(line[-1] - line[-2])
    depth, aside = behind @ along, np.abs(behind @ np.array([-along[1], along[0]]))
    length = float(arc_lengths(line)[-1])
    in_head = (
        (depth > -reach) & (aside < depth * _HEAD_OPENING + 2 * reach) & (depth < _LONGEST_HEAD * length)
    )
    on_line = distance_to_line(ink.pixels, line, widths / 2) < _UNSTEADY
    stray = float(ink.amount[~(in_head | on_line)].sum())
    if stray > _OTHER_HEAD * float(ink.amount[in_head & ~on_line].sum()) + _CLEAR_HEAD:
        return 1.0
    bare = float((coverage_at(ink.coverage, evenly_spaced(line, int(length) + 2)) < 0.5).sum())
    return stray / float(ink.amount.sum()) + max(bare - 2 * MAX_GAP, 0.0) / length


def _widths_at(places: Floats, measured: Floats, kept: list[int]) -> Floats:
    """Return the widths at the points `kept` of a line, from those measured between its ends.

    They change linearly from tail to tip unless the measured ones clearly change from point to point: what
    the pen's pressure does to a short piece would grow where the line goes on within the head.
    """
    knots = [places[0]]
    for place in places[kept[1:-1]]:
        if place - knots[-1] >= _KNOTS and places[-2] - place >= _KNOTS:
            knots.append(place)
    knots.append(places[-1])
    clear = measured > 0
    fits = []
    for ends in ([knots[0], knots[-1]], knots):
        values = values_at_knots(places[1:-1][clear], measured[clear], np.array(ends))
        miss = np.abs(np.interp(places[1:-1], ends, values) - measured)[clear].mean()
        fits.append((float(miss), np.interp(places[kept], ends, values)))
    (straight_miss, straight), (bent_miss, bent) = fits
    return straight if straight_miss < _PRESSURE * bent_miss + 0.03 else bent


def _head(ink: _Ink, beside: npt.NDArray[np.bool_]) -> _Head:
    where = beside
    for _ in range(3):
        share = ink.amount[where] / ink.amount[where].sum()
        center = share @ ink.pixels[where]
        away = np.hypot(*(ink.pixels - center).T)
        # A line of ink reaches 1.73 times as far from its middle as in the root mean square.
        radius = 1.8 * float(np.sqrt(share @ away[where] ** 2)) + 1.0
        where = beside & (away < 1.5 * radius)
    return _Head(center, radius)


def _tip(ink: _Ink, free: Shaft, head: _Head) -> Floats:
    """Return the tip: the foremost point of the head in the direction of the line.

    The line's end would be wrong: on an open head it is the end of a barb, which lies behind the tip.
    """
    last = free.points[-1]
    back = free.points[max(len(free.points) - 1 - int(_DIRECTION / free.spacing), 0)]
    along = _unit(last - back)
    reach = float(np.hypot(*(head.center - last))) + 2.0 * head.radius + free.width
    solid = ink.pixels[ink.amount >= 0.5]
    near = solid[np.hypot(*(solid - last).T) < reach]
    for _ in range(3):
        progress = near @ along
        front = near[progress >= progress.max() - 0.6].mean(axis=0)
        along = _unit(front - last)
    return np.asarray(front + _beyond(ink.coverage, front, along) * along)


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
    if late > _POINTED * early:
        slope, start = np.polyfit(depths, halves, 1)
        return float(np.clip(start / max(slope, 0.1), 0.0, 3.0))
    return 0.5 - float(min(np.median(radii[:4]), 1.2 * WIDTH_AT_FRONT / 2))


def _tail(ink: _Ink, free: Shaft) -> tuple[Floats, int]:
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
    near = np.hypot(*(ink.pixels - here).T) < 2.0 * width + 20.0
    pixels, amount = ink.pixels[near], ink.amount[near]
    backward = _unit(here - free.points[after])
    for _ in range(3):
        behind = (pixels - here) @ backward > 0
        backward = _unit(amount[behind] @ pixels[behind] / max(float(amount[behind].sum()), 1e-9) - here)
    area = float(amount[behind].sum())
    length = area / width
    for _ in range(5):
        at_tail = max(width - slope * length, 1.0)
        length = max((area - np.pi * at_tail**2 / 8) / ((width + at_tail) / 2), 0.0)
    return here + length * backward, inner


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.hypot(*vector)), 1e-9))

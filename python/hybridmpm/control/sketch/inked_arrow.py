"""Reading an arrow from ink: its shaft, its head, and their widths."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from hybridmpm.control.sketch.ink import (
    MAX_GAP,
    Levels,
    Mask,
    coverage_at,
    geodesic_levels,
    labels,
    pixels_of,
)
from hybridmpm.control.sketch.polyline import (
    arc_lengths,
    distance_to_line,
    evenly_spaced,
    values_at_knots,
)
from hybridmpm.control.sketch.sketch import RASTER_SIZE, WIDTH_AT_BACK, WIDTH_AT_FRONT, Arrow, Floats
from hybridmpm.errors import SketchError
from hybridmpm.scene.lines import simplified

MAX_WAY = 2048
"""Longest line; it bounds the time for a maze or a spiral."""
_SPACING = 2.0
"""Distance between points of the line."""
_SMOOTHED = 9
"""Number of points of the shortest path that are averaged; the path runs along pixels."""
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
"""Length of line from which its change of width is extrapolated."""
_BLOCK = 32
"""Number of points of the line whose distances to all ink are in memory at a time."""
_BESIDE = 1.5
"""Distance from the edge of the line up to which ink counts as an unsteady line."""
_LOOKS = 2
"""Number of searches for the head."""
_NEAR_END = 0.4
"""Place along the line, from 0 to 1, from which ink beside it may be the head at its end."""
_CLEAR_HEAD = 8.0
"""Least ink beside the line [pixels] at the end that is the head."""
_NO_HEAD = "the arrow's head looks like its tail: draw one arrow with a clear head at its tip alone"
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
"""Cosine of the sharpest turn of an arrow, 150 degrees; a path that turns back has followed a barb."""
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
    """Return the line between the two ends of a mark that lie farthest apart along the ink.

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
        # Among the barbs of a head the middle of the ink is meaningless.
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
    """Return the shortest path (K, 2) between two ends of a mask, averaged over a few pixels."""
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
    """Return the running means over `count` points; the ends stay in place."""
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
    """Return the offset (K, 2) of the middle of the ink from points of a line (K, 2), and its width (K,)."""
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


def read_arrow(coverage: Floats, mask: Mask) -> Arrow:
    """Return the arrow in one mark of ink, with a width for each point.

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
        The arrow is too short, its head looks like its tail, or there are lines beside it.
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
    """A line through the ink, from its presumed tail to its presumed tip."""

    shaft: Shaft
    distance: Floats
    """Distance (N,) of each pixel of ink to the line."""
    nearest: npt.NDArray[np.intp]
    """Index (N,) of the point of the line that is nearest to the pixel."""


@dataclass(frozen=True)
class _Head:
    """Places of the ink beside the line."""

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
    """Return the distance [pixels] of the tip beyond the middle of the foremost pixel.

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

    The ink behind a point of the line gives the length L from there to the tail. With the widths w there and
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

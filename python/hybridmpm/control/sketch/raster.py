"""Reading a picture: the arrow or oval in its ink."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hybridmpm.control.sketch.ink import Ink, grown, main_mark, pixels_of, read_ink
from hybridmpm.control.sketch.inked_arrow import read_arrow
from hybridmpm.control.sketch.outline import Outline, fit_outline
from hybridmpm.control.sketch.picture import decode
from hybridmpm.control.sketch.sketch import (
    ONE_METRE,
    RASTER_SIZE,
    WIDTH_AT_BACK,
    WIDTH_AT_FRONT,
    Arrow,
    Ellipse,
    Floats,
    StrokeSketch,
    check_in_world,
    margin_of,
)
from hybridmpm.errors import SketchError

MAX_OPENING = np.radians(70)
"""Widest gap of a drawn oval, seen from its middle [rad]."""
_CORE = 0.3
"""Part of an oval, as a fraction of its semi-axes, in which there is hardly any ink unless it is filled."""
_HOLLOW = 0.15
"""Largest part of that core that may be ink."""
_ASIDE = 0.15
"""Largest distance of an unsteady line from the ellipse: this part of the mean semi-axis, beside half the
width of the line."""
_MAX_STRAY = 0.15
"""Largest share of the ink that may lie farther from the ellipse than that."""
_SECTORS = 60
"""Number of sectors over which the width of the line is measured."""
_EDGE = 2
"""Distance from a mark [pixels] within which weaker pixels belong to its smoothed edge."""


def read_oval(coverage: Floats) -> Ellipse:
    """Return the ellipse in the ink of one mark, coverage (512, 512).

    Raises
    ------
    SketchError
        The line has a wide gap, is no oval, or the oval is filled.
    """
    points = pixels_of(coverage > 0)
    weights = coverage[coverage > 0]
    outline = fit_outline(points, weights)
    if outline.gap > MAX_OPENING:
        raise SketchError(
            f"the outline is not closed: its gap is {np.degrees(outline.gap):.0f} degrees wide as seen from "
            f"the middle, at most {np.degrees(MAX_OPENING):.0f} are allowed"
        )
    local = outline.local(points)
    radius = np.hypot(*local.T)
    core = _CORE**2 * np.pi * float(np.prod(outline.axes))
    if weights[radius < _CORE].sum() > _HOLLOW * core:
        raise SketchError("the oval is filled, or its line is too thick for its size: draw its outline alone")
    width = _line_width(outline, local, weights)
    # To first order; the gradient of the radius turns it into a distance in pixels.
    distance = np.abs(radius - 1) * radius / np.maximum(np.hypot(*(local / outline.axes).T), 1e-9)
    aside = width / 2 + _ASIDE * float(np.sqrt(np.prod(outline.axes))) + 1.0
    stray = float(weights[distance > aside].sum() / weights.sum())
    if stray > _MAX_STRAY:
        raise SketchError(
            f"the mark is no oval: {stray:.0%} of its ink lies off the ellipse that fits it best, at most "
            f"{_MAX_STRAY:.0%} may; draw one closed outline"
        )
    center = np.array([outline.center[0], RASTER_SIZE - outline.center[1]]) / RASTER_SIZE
    # Rows count downwards, which turns the sense of the angle.
    angle = (np.pi / 2 - outline.angle) % np.pi - np.pi / 2
    return Ellipse(
        center, outline.axes / RASTER_SIZE, float(angle), float(np.clip(width, WIDTH_AT_BACK, WIDTH_AT_FRONT))
    )


def _line_width(outline: Outline, local: Floats, weights: Floats) -> float:
    """Return the width of the line [pixels]: the median, over directions, of ink by length of the ellipse.

    The median is insensitive to a line that was drawn twice, and to gaps.
    """
    turn = np.arctan2(local[:, 1], local[:, 0])
    sector = ((turn + np.pi) / (2 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS
    ink = np.bincount(sector, weights, _SECTORS)
    middle = (np.arange(_SECTORS) + 0.5) * 2 * np.pi / _SECTORS - np.pi
    major, minor = outline.axes
    length = np.hypot(major * np.sin(middle), minor * np.cos(middle)) * 2 * np.pi / _SECTORS
    return float(np.median((ink / length)[ink > 0]))


def parse_png(data: bytes, size: Sequence[float] = ONE_METRE) -> StrokeSketch:
    """Return the sketch in a picture, a PNG, JPEG or WebP.

    The ground is the colour of most pixels, near each place where the light is uneven. Red ink is an arrow,
    green ink an oval; ink of any other colour is an oval if it goes round, else an arrow. The head of an
    arrow is the end with more ink beside the line. Gaps of up to 12 pixels (of 512) are bridged, an oval may
    be open by up to 70 degrees or be drawn round more than once. The width of the line gives the widths of
    the sketch, and so the depth in 3D.

    Parameters
    ----------
    data : bytes
        A still picture of 16 to 4096 pixels a side and at most 1 MiB, turned as its EXIF orientation says.
        Transparent pixels are white, or black where the ink is white. A picture that is not square is fitted
        into the middle of a square, as `note` of the sketch says.
    size : sequence of 2 or 3 floats
        Length of the world along each axis [m], as `Scene.size` has it. Its front is in the middle of the
        square; its longest side is as long as that.

    Raises
    ------
    SketchError
        The data are no such picture; or it is blank, has too little or too much ink, several marks, or red
        and green ink together; or an outline is open, filled or no oval; or an arrow is too short, its head
        looks like its tail, or there are other lines beside it.
    """
    picture, note = decode(data)
    sketch = _sketch_in(read_ink(picture, is_lossy=not data.startswith(b"\x89PNG")))
    longest, margin = max(size), margin_of(size)
    if isinstance(sketch, Arrow):
        points = np.clip(longest * sketch.points - margin, 0.0, size[:2])
        placed: StrokeSketch = replace(sketch, points=points, note=note)
    else:
        center, axes = longest * sketch.center - margin, longest * sketch.axes
        if not np.all(center >= 0):
            raise SketchError("the middle of the oval lies beside the world: draw it within")
        placed = replace(sketch, center=center, axes=axes, note=note)
    check_in_world(placed, size)
    return placed


def _sketch_in(ink: Ink) -> StrokeSketch:
    mark, bridged = main_mark(ink.mask)
    coverage = np.where(grown(mark, _EDGE), ink.coverage, 0.0)
    if ink.color == "red":
        return read_arrow(coverage, bridged)
    if ink.color == "green":
        return read_oval(coverage)
    try:
        return read_oval(coverage)
    except SketchError:
        return read_arrow(coverage, bridged)

"""Reading an oval from its ink: the ellipse along the middle of the line, and the width of the line."""

import numpy as np

from hybridmpm.control.sketch.outline import Outline, fit_outline
from hybridmpm.control.sketch.picture.ink import pixels_of
from hybridmpm.control.sketch.sketch import RASTER_SIZE, WIDTH_AT_BACK, WIDTH_AT_FRONT, Ellipse, Floats
from hybridmpm.errors import SketchError

MAX_OPENING = np.radians(70)
"""Widest gap of a drawn oval, seen from its middle [rad]."""
_CORE = 0.3
"""Part of an oval, as a fraction of its semi-axes, in which there is hardly any ink unless it is filled."""
_HOLLOW = 0.15
"""Largest part of that core that may be ink."""
_ASIDE = 0.15
"""Distance from the ellipse up to which an unsteady line is an oval still: this part of the mean semi-axis,
beside half the width of the line."""
_MAX_STRAY = 0.15
"""Largest share of the ink that may lie farther from the ellipse than that."""
_SECTORS = 60
"""Number of sectors over which the width of the line is measured."""


def read_oval(coverage: Floats) -> Ellipse:
    """Return the ellipse that the ink of one mark, coverage (512, 512), shows.

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

    The median does not see where the line was drawn twice, nor a gap.
    """
    turn = np.arctan2(local[:, 1], local[:, 0])
    sector = ((turn + np.pi) / (2 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS
    ink = np.bincount(sector, weights, _SECTORS)
    middle = (np.arange(_SECTORS) + 0.5) * 2 * np.pi / _SECTORS - np.pi
    major, minor = outline.axes
    length = np.hypot(major * np.sin(middle), minor * np.cos(middle)) * 2 * np.pi / _SECTORS
    return float(np.median((ink / length)[ink > 0]))

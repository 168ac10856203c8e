"""Reading a PNG: its pixels, its ink, and the arrow or oval in the ink."""

import io
import struct
import zlib

import numpy as np
import numpy.typing as npt
from PIL import Image

from hybridmpm.control.sketch.ink import grown, main_mark, pixels_of, read_ink
from hybridmpm.control.sketch.inked_arrow import read_arrow
from hybridmpm.control.sketch.outline import Outline, fit_outline
from hybridmpm.control.sketch.sketch import (
    RASTER_SIZE,
    WIDTH_AT_BACK,
    WIDTH_AT_FRONT,
    Ellipse,
    Floats,
    Sketch,
)
from hybridmpm.errors import SketchError

MAX_BYTES = 1 << 20
"""Largest size of a PNG [bytes]."""
MIN_SIDE = 16
"""Smallest side of a PNG [pixels]."""
MAX_SIDE = 2048
"""Largest side of a PNG [pixels]."""

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_DECODE_ERRORS = (OSError, SyntaxError, ValueError, EOFError, IndexError, struct.error, zlib.error)
"""Exceptions that Pillow's PNG plugin raises on damaged files."""
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


def decode_png(data: bytes) -> npt.NDArray[np.uint8]:
    """Return the picture of a PNG on a white ground, uint8 (512, 512, 3), row 0 on top.

    The size is read from the header before anything is decoded, so that a small file cannot claim a large
    memory.

    Parameters
    ----------
    data : bytes
        A still, square PNG of 16 to 2048 pixels a side and at most 1 MiB.

    Raises
    ------
    SketchError
        The data are no PNG, or it is animated, not square, too large, truncated or damaged.
    """
    if len(data) > MAX_BYTES:
        raise SketchError(f"the PNG has {len(data)} bytes, at most {MAX_BYTES} are allowed")
    if not data.startswith(_SIGNATURE):
        raise SketchError("the file is not a PNG; send a 512 x 512 PNG or JSON strokes")
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise SketchError("the PNG is truncated: its header is incomplete")
    width, height = struct.unpack(">II", data[16:24])
    if not (MIN_SIDE <= width <= MAX_SIDE and MIN_SIDE <= height <= MAX_SIDE):
        raise SketchError(f"the PNG is {width} x {height} pixels, each side must be {MIN_SIDE} to {MAX_SIDE}")
    if width != height:
        raise SketchError(f"the PNG is {width} x {height} pixels, it must be square")
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as image:
            if getattr(image, "is_animated", False):
                raise SketchError("the PNG is animated, it must be a still picture")
            picture = image.convert("RGBA")
    except _DECODE_ERRORS as err:
        raise SketchError(f"the PNG is truncated or damaged: {err}") from err
    ground = Image.new("RGBA", picture.size, (255, 255, 255, 255))
    flat = Image.alpha_composite(ground, picture).convert("RGB")
    if flat.size != (RASTER_SIZE, RASTER_SIZE):
        smaller = width > RASTER_SIZE
        flat = flat.resize(
            (RASTER_SIZE, RASTER_SIZE), Image.Resampling.BOX if smaller else Image.Resampling.BILINEAR
        )
    return np.asarray(flat, dtype=np.uint8)


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


def parse_png(data: bytes) -> Sketch:
    """Return the sketch in a PNG.

    The ground is the colour of most pixels. Red ink is an arrow, green ink an oval; ink of any other colour
    is an oval if it goes round, else an arrow. The head of an arrow is the end with more ink beside the
    line. Gaps of up to 12 pixels (of 512) are bridged, an oval may be open by up to 70 degrees or be drawn
    round more than once. The width of the line gives the widths of the sketch, and so the depth in 3D.

    Parameters
    ----------
    data : bytes
        A still, square PNG of 16 to 2048 pixels a side and at most 1 MiB. Transparent pixels are white.

    Raises
    ------
    SketchError
        The data are no such PNG; or the picture is blank, has too little or too much ink, several marks, or
        red and green ink together; or an outline is open, filled or no oval; or an arrow is too short, its
        head looks like its tail, or there are other lines beside it.
    """
    ink = read_ink(decode_png(data))
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

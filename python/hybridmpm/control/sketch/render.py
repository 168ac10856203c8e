"""Drawing sketches as rasters: a red arrow or a green outline on white, or whatever a hand has drawn."""

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image

from hybridmpm.control.sketch.polyline import arc_lengths, at_arc_length
from hybridmpm.control.sketch.sketch import (
    ONE_METRE,
    RASTER_SIZE,
    Arrow,
    Ellipse,
    Floats,
    Sketch,
    margin_of,
)
from hybridmpm.errors import SketchError

ARROW_WIDTH = 4.0
"""Width of the shaft of an arrow without widths [pixels]."""
OUTLINE_WIDTH = 3.0
"""Width of the outline of an ellipse without width [pixels]."""
HEAD_REACH = 10.0
"""Distance [pixels] by which a head reaches beyond each side of its shaft."""
HEAD_SLOPE = 0.45
"""Half width of a head over its length."""
MAX_HEAD = 0.4
"""Largest length of a head as a fraction of its arrow's length."""
RED = (220, 20, 30)
GREEN = (96, 200, 96)
WHITE = (255, 255, 255)

Color = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class PenStroke:
    """One line of a drawing."""

    points: Floats
    """Points (K, 2) in the front view [m], y up; what lies outside of the picture is not seen."""
    widths: Floats
    """Width at each point (K,) [pixels of the 512-pixel raster]."""
    times: Floats | None = None
    """Time at which each point was drawn (K,) [s]."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """Lines and filled shapes of one colour on a ground."""

    strokes: tuple[PenStroke, ...]
    fills: tuple[Floats, ...] = ()
    """Corners (K, 2) of filled convex polygons [m]."""
    color: Color = RED
    """Red, green and blue of the ink, 0 to 255."""
    ground: Color = WHITE
    """Red, green and blue of the ground, 0 to 255."""


def drawing_of(sketch: Sketch, longest: float = 1.0) -> Drawing:
    """Return the drawing of a sketch in a world whose longest side is given [m].

    An arrow has a shaft of its widths, or of `ARROW_WIDTH`, and a filled triangular head whose point is the
    tip. The widths change linearly along each segment. An ellipse is one closed outline, a shape and a
    solid some.
    """
    if isinstance(sketch, Arrow):
        return _drawn_arrow(sketch, longest)
    lines = (sketch.outline(257),) if isinstance(sketch, Ellipse) else sketch.outlines
    width = OUTLINE_WIDTH if sketch.width is None else sketch.width
    closed = [np.vstack([line, line[:1]]) for line in lines]
    return Drawing(tuple(PenStroke(line, np.full(len(line), width)) for line in closed), color=GREEN)


def render(drawing: Sketch | Drawing, size: Sequence[float] = ONE_METRE) -> npt.NDArray[np.uint8]:
    """Return a sketch or a drawing as a picture, uint8 (512, 512, 4) RGBA, opaque, row 0 on top.

    The front of the world of a `size` [m] is in the middle; its longest side is as long as the picture.
    """
    if not isinstance(drawing, Drawing):
        drawing = drawing_of(drawing, max(size))
    coverage = np.zeros((RASTER_SIZE, RASTER_SIZE))
    for stroke in drawing.strokes:
        _draw_stroke(coverage, _to_pixels(stroke.points, size), stroke.widths / 2)
    for corners in drawing.fills:
        _fill(coverage, _to_pixels(corners, size))
    ink, ground = np.array(drawing.color), np.array(drawing.ground)
    picture = np.empty((RASTER_SIZE, RASTER_SIZE, 4), dtype=np.uint8)
    picture[:] = (*drawing.ground, 255)
    inked = coverage > 0
    picture[inked, :3] = np.rint(ground + coverage[inked, None] * (ink - ground))
    return picture


def render_png(drawing: Sketch | Drawing, size: Sequence[float] = ONE_METRE) -> bytes:
    """Return the picture of `render` as a PNG, 512 x 512 RGBA; `parse_png` reads the sketch from it."""
    data = io.BytesIO()
    Image.fromarray(render(drawing, size)).save(data, "PNG")
    return data.getvalue()


def _drawn_arrow(arrow: Arrow, longest: float) -> Drawing:
    widths = np.full(len(arrow.points), ARROW_WIDTH) if arrow.widths is None else arrow.widths
    lengths = arc_lengths(arrow.points)
    total, at_tip = float(lengths[-1]), float(widths[-1])
    pixel = longest / RASTER_SIZE
    head = min((at_tip / 2 + HEAD_REACH) / HEAD_SLOPE * pixel, MAX_HEAD * total)
    half = max(HEAD_SLOPE * head, (at_tip / 2 + HEAD_REACH / 2) * pixel)
    # The direction over the length of the head, so that the head of a bent arrow covers its shaft.
    neck, end = at_arc_length(arrow.points, np.array([total - head, total - 0.6 * head]))
    along = (arrow.points[-1] - neck) / max(float(np.hypot(*(arrow.points[-1] - neck))), 1e-9)
    across = np.array([-along[1], along[0]])
    base = arrow.points[-1] - head * along
    # The shaft ends within the head, so that nothing reaches beyond the tip.
    inside = lengths < total - 0.6 * head
    shaft = PenStroke(
        np.vstack([arrow.points[inside], end]),
        np.append(widths[inside], np.interp(total - 0.6 * head, lengths, widths)),
    )
    return Drawing((shaft,), (np.vstack([base + half * across, arrow.points[-1], base - half * across]),))


def _to_pixels(points: Floats, size: Sequence[float]) -> Floats:
    if not np.isfinite(points).all():
        raise SketchError("a drawing must be made of finite numbers")
    places = (points + margin_of(size)) / max(size)
    return np.column_stack([places[:, 0], 1.0 - places[:, 1]]) * RASTER_SIZE


def _draw_stroke(coverage: Floats, points: Floats, radii: Floats) -> None:
    """Draw a stroke with round ends and joints; its width changes linearly along each segment."""
    for a, b, at_a, at_b in zip(points, points[1:], radii, radii[1:], strict=False):
        reach = max(at_a, at_b) + 1.0
        window, x, y = _window(coverage, np.minimum(a, b) - reach, np.maximum(a, b) + reach)
        dx, dy = b - a
        along = np.clip(((x - a[0]) * dx + (y - a[1]) * dy) / max(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
        outside = np.hypot(x - a[0] - along * dx, y - a[1] - along * dy) - at_a - along * (at_b - at_a)
        np.maximum(window, np.clip(0.5 - outside, 0.0, 1.0), out=window)


def _fill(coverage: Floats, corners: Floats) -> None:
    """Fill a convex polygon."""
    window, x, y = _window(coverage, corners.min(axis=0) - 1.0, corners.max(axis=0) + 1.0)
    middle = corners.mean(axis=0)
    outside = np.full(window.shape, -np.inf)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / max(float(np.hypot(*(b - a))), 1e-9)
        normal *= np.sign((a - middle) @ normal)
        np.maximum(outside, (x - a[0]) * normal[0] + (y - a[1]) * normal[1], out=outside)
    np.maximum(window, np.clip(0.5 - outside, 0.0, 1.0), out=window)


def _window(coverage: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the pixels of a rectangle, as a view, and the middles of its columns (1, W) and rows (H, 1)."""
    left, top = np.clip(np.floor(low), 0, RASTER_SIZE).astype(int)
    right, bottom = np.clip(np.ceil(high), 0, RASTER_SIZE).astype(int)
    x, y = np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5
    return coverage[top:bottom, left:right], x[None, :], y[:, None]

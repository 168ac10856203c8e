"""Drawing a sketch as a raster, as the paper does: a red arrow or a green outline on white."""

import io

import numpy as np
from PIL import Image, ImageDraw

from hybridmpm.control.sketch.sketch import RASTER_SIZE, Arrow, Ellipse, Floats, Sketch

ARROW_WIDTH = 4.0
"""Width of the shaft of an arrow without widths [pixels]."""
OUTLINE_WIDTH = 3.0
"""Width of the outline of an ellipse without width [pixels]."""
HEAD_LENGTH = 26.0
"""Length of a head along the shaft [pixels]; heads of short arrows are shorter."""
MAX_HEAD = 0.4
"""Largest length of a head as a fraction of its arrow's length."""
HEAD_SLOPE = 0.45
"""Half width of a head over its length."""

_OVERSAMPLING = 4
_RED = (220, 20, 30, 255)
_GREEN = (96, 200, 96, 255)
_WHITE = (255, 255, 255, 255)


def render_png(sketch: Sketch) -> bytes:
    """Return a sketch as a PNG, 512 x 512 RGBA on white; `parse_png` reads the sketch from it.

    An arrow without widths has a shaft of 4 pixels and a filled triangular head that ends at the tip. An
    arrow with widths has a tapering shaft and a head of two open strokes. An ellipse is one closed outline.
    """
    side = RASTER_SIZE * _OVERSAMPLING
    image = Image.new("RGBA", (side, side), _WHITE)
    pen = _Pen(ImageDraw.Draw(image))
    if isinstance(sketch, Arrow):
        _draw_arrow(pen, sketch)
    else:
        _draw_ellipse(pen, sketch)
    data = io.BytesIO()
    image.resize((RASTER_SIZE, RASTER_SIZE), Image.Resampling.BOX).save(data, "PNG")
    return data.getvalue()


class _Pen:
    """Draws on the oversampled picture; all lengths are in pixels of the final raster."""

    def __init__(self, draw: ImageDraw.ImageDraw) -> None:
        self._draw = draw

    def polygon(self, points: Floats, color: tuple[int, int, int, int]) -> None:
        self._draw.polygon([(float(x), float(y)) for x, y in points * _OVERSAMPLING], fill=color)

    def polyline(self, points: Floats, widths: Floats, color: tuple[int, int, int, int]) -> None:
        """Draw a stroke with round ends and joints; its width changes linearly along each segment."""
        for a, b, at_a, at_b in zip(points, points[1:], widths, widths[1:], strict=False):
            along = b - a
            length = float(np.hypot(*along))
            if length > 0:
                across = np.array([-along[1], along[0]]) / length / 2
                self.polygon(
                    np.array([a + across * at_a, b + across * at_b, b - across * at_b, a - across * at_a]),
                    color,
                )
        for point, width in zip(points, widths, strict=True):
            x, y = (float(value) for value in point * _OVERSAMPLING)
            radius = float(width) * _OVERSAMPLING / 2
            self._draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=color)


def _to_pixels(points: Floats) -> Floats:
    return np.column_stack([points[:, 0], 1.0 - points[:, 1]]) * RASTER_SIZE


def _draw_arrow(pen: _Pen, arrow: Arrow) -> None:
    points = _to_pixels(arrow.points)
    tip = points[-1]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = min(HEAD_LENGTH, MAX_HEAD * float(steps.sum()))
    along = tip - _point_before_tip(points, length)
    along = along / max(float(np.hypot(*along)), 1e-9)
    across = np.array([-along[1], along[0]])
    barbs = tip - length * along + np.outer([HEAD_SLOPE, -HEAD_SLOPE], length * across)
    if arrow.widths is None:
        # The shaft stops inside the head, so that nothing reaches beyond the tip.
        shaft = np.vstack([points[:-1], tip - 0.5 * length * along])
        pen.polyline(shaft, np.full(len(shaft), ARROW_WIDTH), _RED)
        pen.polygon(np.vstack([barbs[0], tip, barbs[1]]), _RED)
    else:
        pen.polyline(points, arrow.widths, _RED)
        thin = min(ARROW_WIDTH, float(arrow.widths[-1]))
        # A wide shaft would swallow a head of the usual size.
        reach = 1.0 + float(arrow.widths[-1]) / (2.0 * HEAD_SLOPE * length)
        for barb in barbs:
            pen.polyline(np.array([tip, tip + reach * (barb - tip)]), np.full(2, thin), _RED)


def _point_before_tip(points: Floats, distance: float) -> Floats:
    """Return the last point of the polyline that is `distance` from the tip in a straight line.

    If all points are nearer, it is the tail.
    """
    far = np.flatnonzero(np.linalg.norm(points - points[-1], axis=1) >= distance)
    if not far.size:
        return np.asarray(points[0])
    outside, inside = points[far[-1]], points[far[-1] + 1]
    fractions = np.linspace(0.0, 1.0, 65)[:, None]
    between = outside + fractions * (inside - outside)
    gap = np.abs(np.linalg.norm(between - points[-1], axis=1) - distance)
    return np.asarray(between[int(gap.argmin())])


def _draw_ellipse(pen: _Pen, ellipse: Ellipse) -> None:
    turn = np.linspace(0.0, 2 * np.pi, 257)
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    local = np.column_stack([np.cos(turn), np.sin(turn)]) * ellipse.axes
    outline = ellipse.center + local @ np.array([[cos, sin], [-sin, cos]])
    width = OUTLINE_WIDTH if ellipse.width is None else ellipse.width
    pen.polyline(_to_pixels(outline), np.full(len(outline), width), _GREEN)

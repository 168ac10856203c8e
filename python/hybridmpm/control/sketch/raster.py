"""From the raster form of a sketch, a PNG, to an arrow or an ellipse."""

import numpy as np

from hybridmpm.control.sketch.arrow import read_arrow, stroke_ends
from hybridmpm.control.sketch.ink import MIN_INK, Mask, filled, ink_masks, main_mark, pixels_of
from hybridmpm.control.sketch.png import decode_png
from hybridmpm.control.sketch.sketch import RASTER_SIZE, WIDTH_AT_BACK, WIDTH_AT_FRONT, Ellipse, Sketch
from hybridmpm.control.sketch.strokes import CLOSED_GAP, ellipse_of_moments
from hybridmpm.errors import SketchError


def parse_png(data: bytes) -> Sketch:
    """Return the sketch that a PNG shows.

    A red mark is an arrow, a green mark an ellipse. Without either, a dark mark is read: as an ellipse if it
    is closed, else as an arrow. The head of an arrow is the end with more ink than the stroke alone has. The
    width of the stroke gives the widths of the sketch.

    Parameters
    ----------
    data : bytes
        A still, square PNG of 16 to 2048 pixels a side and at most 1 MiB. Transparent pixels are white.

    Raises
    ------
    SketchError
        The data are no such PNG; or the picture is blank, has too little or too much ink, several marks, or
        red and green ink together; or an outline has a wide gap; or an arrow's head cannot be told from its
        tail.
    """
    masks = {name: mask for name, mask in ink_masks(decode_png(data)).items() if mask.any()}
    if not masks:
        raise SketchError("the sketch is blank: draw a red arrow or a green outline on white")
    # A few stray pixels of another colour are no second sketch.
    colors = [name for name in ("red", "green") if name in masks and masks[name].sum() >= MIN_INK]
    if len(colors) == 2:
        raise SketchError("the sketch has red and green ink: send one arrow or one outline at a time")
    name = colors[0] if colors else max(masks, key=lambda key: int(masks[key].sum()))
    mark = main_mark(masks[name])
    if name == "red":
        return read_arrow(mark)
    if name == "green":
        return _read_ellipse(_closed(mark))
    try:
        outline = _closed(mark)
    except SketchError:
        return read_arrow(mark)
    return _read_ellipse(outline)


def _closed(mark: Mask) -> Mask:
    """Return the closed outline; a small gap between the ends of its stroke is bridged.

    Raises
    ------
    SketchError
        The gap is too wide.
    """
    if _encloses(mark):
        return mark
    start, end, length = stroke_ends(mark)
    gap = float(np.linalg.norm(end - start))
    if gap < CLOSED_GAP * length:
        bridged = mark.copy()
        steps = np.linspace(start, end, 2 * int(gap) + 2).astype(int)
        for shift in ((0, 0), (0, 1), (1, 0)):
            rows, columns = (steps[:, ::-1] + shift).clip(0, RASTER_SIZE - 1).T
            bridged[rows, columns] = True
        if _encloses(bridged):
            return bridged
    raise SketchError(
        f"the outline is not closed: its ends are {gap:.0f} pixels apart, "
        f"at most {CLOSED_GAP:.0%} of its length ({CLOSED_GAP * length:.0f}) are allowed"
    )


def _encloses(mark: Mask) -> bool:
    """Return whether the mark encloses a hole that is larger than any inside an arrow's head."""
    hole = int(filled(mark).sum()) - int(mark.sum())
    return hole > max(MIN_INK, 0.1 * int(mark.sum()))


def _read_ellipse(outline: Mask) -> Ellipse:
    """Return the ellipse midway between the outer and the inner edge of the outline."""
    whole = filled(outline)
    outer = _moments(whole)
    inner = _moments(whole & ~outline)
    width = float(np.clip(np.mean(outer.axes - inner.axes) * RASTER_SIZE, WIDTH_AT_BACK, WIDTH_AT_FRONT))
    return Ellipse(outer.center, (outer.axes + inner.axes) / 2, outer.angle, width)


def _moments(region: Mask) -> Ellipse:
    points = pixels_of(region) / RASTER_SIZE
    points[:, 1] = 1.0 - points[:, 1]
    return ellipse_of_moments(points.mean(axis=0), np.cov(points, rowvar=False), None)

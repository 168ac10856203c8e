"""Shapes traced from pictures and texts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from hybridmpm._support.arguments import real
from hybridmpm.control.sketch.picture import decode
from hybridmpm.control.sketch.polyline import simplified
from hybridmpm.control.sketch.sketch import MAX_OUTLINES, RASTER_SIZE, Floats, Shape
from hybridmpm.errors import ConfigError, SketchError
from hybridmpm.scene.fields import LONGEST

_FONT_PIXELS = 240
"""Height of the letters that are traced [pixels]."""
_FEW_POINTS = 512
"""Points of all lines together beyond which traced lines are made simpler."""
_LEAST = 1e-6
"""Smallest height of a traced shape [m]."""


def shape_of_picture(
    picture: bytes | Image.Image | npt.ArrayLike,
    center: Sequence[float],
    height: float,
    width: float | None = None,
) -> Shape:
    """Return the shape of the dark parts of a picture, as of a logo.

    Parameters
    ----------
    picture : bytes, PIL.Image.Image, or float or uint8 (H, W)
        A PNG, JPEG or WebP file of at most 1 MiB, or grey values; those below the middle of their range are
        inside. A picture with an alpha channel is laid on white.
    center : float (2,)
        Middle of the rectangle around the shape [m].
    height : float in [1e-6, 4096]
        Height of that rectangle [m].
    width : float in [2, 20], optional
        As of `Shape`.

    Raises
    ------
    SketchError
        The picture has no dark part, or no light one, or the file is damaged, too large or of another kind.
    ConfigError
        contourpy is not installed: pip install 'hybridmpm[shapes]'.
    """
    if isinstance(picture, bytes):
        picture = Image.fromarray(decode(picture)[0])
    if isinstance(picture, Image.Image):
        rgba = picture.convert("RGBA")
        ground = Image.new("RGBA", rgba.size, "white")
        picture = np.asarray(Image.alpha_composite(ground, rgba).convert("L"))
    grey = np.asarray(picture, dtype=np.float64)
    if grey.ndim != 2 or min(grey.shape) < 2 or not np.isfinite(grey).all():
        raise SketchError(f"picture must be finite numbers (H, W), got shape {grey.shape}")
    middle = (grey.min() + grey.max()) / 2
    if not grey.min() < middle:
        raise SketchError("picture: all of it is equally dark; a shape needs dark parts on a light ground")
    return Shape(_traced(middle - grey, center, real("height", height, _LEAST, LONGEST)), width)


def shape_of_text(text: str, center: Sequence[float], height: float, width: float | None = None) -> Shape:
    """Return the shape of some words in the font Aileron (CC0), which Pillow contains.

    Parameters are those of `shape_of_picture`, and the text; `height` is that of the rectangle around it.

    Raises
    ------
    SketchError
        The text has no letter that can be seen.
    ConfigError
        contourpy is not installed: pip install 'hybridmpm[shapes]'.
    """
    if not isinstance(text, str) or not text.strip():
        raise SketchError(f"text must have letters that can be seen, got {text!r}")
    font = ImageFont.load_default(_FONT_PIXELS)
    left, top, right, bottom = font.getbbox(text)
    edge = 4
    picture = Image.new("L", (int(right - left) + 2 * edge, int(bottom - top) + 2 * edge), "white")
    ImageDraw.Draw(picture).text((edge - left, edge - top), text, fill="black", font=font)
    return shape_of_picture(picture, center, height, width)


def _traced(inside: Floats, center: Sequence[float], height: float) -> tuple[Floats, ...]:
    """Return the lines around the positive values (H, W) of a picture, at a place and of a height [m]."""
    try:
        import contourpy  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("tracing a picture needs contourpy: pip install 'hybridmpm[shapes]'") from None
    edged = np.pad(inside, 1, constant_values=min(float(inside.min()), -1e-9))
    generator: Any = contourpy.contour_generator(z=edged)
    # Row 0 is on top.
    lines = [line[:-1] * [1.0, -1.0] for line in generator.lines(0.0) if len(line) > 3]
    if not lines:
        raise SketchError("picture: it has no dark part that can be traced")
    return placed(lines, center, height)


def placed(lines: Sequence[Floats], center: Sequence[float], height: float) -> tuple[Floats, ...]:
    """Return closed lines at a place and of a height [m], made simpler where they have many points.

    Raises
    ------
    SketchError
        There are too many.
    """
    points = np.concatenate(lines)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = height / (high[1] - low[1])
    found = [(line - (low + high) / 2) * scale + np.asarray(center, dtype=np.float64) for line in lines]
    tolerance = height / RASTER_SIZE
    while sum(map(len, found)) > _FEW_POINTS and tolerance < height / 16:
        simple = [line[simplified(np.vstack([line, line[:1]]), tolerance)[:-1]] for line in found]
        found = [line for line in simple if len(line) > 2]
        tolerance *= 1.5
    if len(found) > MAX_OUTLINES:
        raise SketchError(f"it has {len(found)} parts, at most {MAX_OUTLINES} are allowed; make it simpler")
    return tuple(np.ascontiguousarray(line) for line in found)

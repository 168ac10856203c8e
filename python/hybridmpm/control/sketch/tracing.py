"""Shapes traced from pictures and texts."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from hybridmpm._support.arguments import real
from hybridmpm.control.sketch.picture import decode
from hybridmpm.control.sketch.sketch import MAX_OUTLINES, RASTER_SIZE, Floats, Shape
from hybridmpm.errors import DataError, SketchError
from hybridmpm.scene.fields import LONGEST
from hybridmpm.scene.files import dark_lines, grey_of, placed
from hybridmpm.scene.svg import path_lines

_FONT_PIXELS = 240
"""Height of the letters that are traced [pixels]."""
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
    grey = grey_of(picture) if isinstance(picture, Image.Image) else np.asarray(picture, dtype=np.float64)
    if grey.ndim != 2 or min(grey.shape) < 2 or not np.isfinite(grey).all():
        raise SketchError(f"picture must be finite numbers (H, W), got shape {grey.shape}")
    return Shape(_placed(lambda: dark_lines(grey), center, height), width)


def shape_of_path(path: str, center: Sequence[float], height: float, width: float | None = None) -> Shape:
    """Return the shape of an SVG path, the attribute `d` of its element, by the even-odd rule.

    Curves become lines of 16 pieces. Parts that are not closed are closed by a straight line.

    Parameters
    ----------
    path : str
        Commands of an SVG path, absolute or relative.
    center : float (2,)
        Middle of the rectangle around the shape [m].
    height : float in [1e-6, 4096]
        Height of that rectangle [m].
    width : float in [2, 20], optional
        As of `Shape`.

    Raises
    ------
    SketchError
        The path is none, or encloses nothing.
    ConfigError
        svgpathtools is not installed: pip install 'hybridmpm[shapes]'.
    """
    return Shape(_placed(lambda: path_lines(path), center, height), width)


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


def _placed(
    lines: Callable[[], Sequence[Floats]], center: Sequence[float], height: float
) -> tuple[Floats, ...]:
    """Return lines of a file at a place and of a height [m]; their faults are those of a sketch."""
    try:
        found = placed(lines(), center, real("height", height, _LEAST, LONGEST), RASTER_SIZE)
    except DataError as error:
        raise SketchError(str(error)) from None
    if len(found) > MAX_OUTLINES:
        raise SketchError(f"it has {len(found)} parts, at most {MAX_OUTLINES} are allowed; make it simpler")
    return tuple(found)

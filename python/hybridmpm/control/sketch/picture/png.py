"""Reading a PNG from an unknown sender: it is checked before it is decoded, and scaled to 512 x 512."""

import io
import struct
import zlib

import numpy as np
import numpy.typing as npt
from PIL import Image

from hybridmpm.control.sketch.sketch import RASTER_SIZE
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

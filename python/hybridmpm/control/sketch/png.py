"""Reading a PNG from a stranger: checked before it is decoded, and always 512 x 512 afterwards."""

import io
import struct
import zlib

import numpy as np
import numpy.typing as npt
from PIL import Image

from hybridmpm.control.sketch.sketch import RASTER_SIZE
from hybridmpm.errors import SketchError

MAX_BYTES = 1 << 20
"""Largest compressed sketch [bytes]."""
MIN_SIDE = 16
MAX_SIDE = 2048
"""Allowed sides of the raster [pixels]."""

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_DECODE_ERRORS = (OSError, SyntaxError, ValueError, EOFError, IndexError, struct.error, zlib.error)
"""What Pillow's PNG plugin raises on damaged files."""


def decode_png(data: bytes) -> npt.NDArray[np.uint8]:
    """Return the picture on a white ground, uint8 (512, 512, 3), row 0 on top.

    Parameters
    ----------
    data : bytes
        A still PNG, square, 16 to 2048 pixels a side, at most 1 MiB.

    Raises
    ------
    SketchError
        Not a PNG, animated, too large, truncated or damaged. The size is read from the header
        before anything is decoded, so a small file cannot ask for a large memory.
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

"""Decoding a picture: PNG, JPEG or WebP of any kind and shape, as 512 x 512 pixels on an opaque ground."""

import contextlib
import io
import struct
import zlib

import numpy as np
import numpy.typing as npt
from PIL import Image

from hybridmpm.control.sketch.sketch import RASTER_SIZE
from hybridmpm.errors import SketchError

MAX_BYTES = 1 << 20
"""Largest size of a picture [bytes]."""
MIN_SIDE = 16
"""Smallest side of a picture [pixels]."""
MAX_SIDE = 4096
"""Largest side of a picture [pixels]."""
_HALVED_ABOVE = 2048
"""Largest side that is worked on as a whole; larger pictures are halved first, band by band."""
_MARGIN, _SPAN = 16, 56
"""Depth and half of the length of a part of an edge whose median is the ground there [pixels]."""
_BAND = 256
"""Rows of a band."""
_MAX_SCANS = 40
"""Most scans of a JPEG and of the small picture in it."""
_FAINT = 32
"""Least difference from white of ink that shows on white, of 255."""

_FORMATS = ("PNG", "JPEG", "WEBP")
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_ERRORS = (
    OSError,
    SyntaxError,
    ValueError,
    EOFError,
    IndexError,
    KeyError,
    TypeError,
    OverflowError,
    struct.error,
    zlib.error,
)
"""Exceptions that Pillow's plugins raise on damaged files."""
_ORIENTATION = 0x0112
_TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
"""What turns a picture the way up that its orientation, a number of EXIF, means."""


def decode(data: bytes) -> tuple[npt.NDArray[np.uint8], str | None]:
    """Return a picture as uint8 (512, 512, 3), row 0 on top, and a note if it had to be fitted.

    The size is read from the header before anything is decoded, so that a small file cannot claim a large
    memory.

    Raises
    ------
    SketchError
        The data are no PNG, JPEG or WebP, or the picture is animated, too large, truncated or damaged.
    """
    if len(data) > MAX_BYTES:
        raise SketchError(f"the picture has {len(data)} bytes, at most {MAX_BYTES} are allowed")
    if data.startswith(_SIGNATURE):
        if len(data) < 33 or data[12:16] != b"IHDR":
            raise SketchError("the PNG is truncated: its header is incomplete")
        _check_size(*struct.unpack(">II", data[16:24]))
    elif not (data.startswith(b"\xff\xd8\xff") or (data.startswith(b"RIFF") and data[8:12] == b"WEBP")):
        raise SketchError("the file is no PNG, JPEG or WebP; send a 512 x 512 PNG or JSON strokes")
    # A scan of few bytes costs as much as one of all pixels; a progressive JPEG has about ten.
    if data.startswith(b"\xff\xd8") and data.count(b"\xff\xda") > _MAX_SCANS:
        raise SketchError(f"the JPEG has more than {_MAX_SCANS} scans: save it anew, not progressive")
    try:
        with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
            _check_size(*image.size)
            if image.format != "JPEG" and getattr(image, "is_animated", False):
                raise SketchError("the picture is animated, it must be a still one")
            # A JPEG is decoded at a fraction of its size, which takes a fraction of the time.
            image.draft(None, (_HALVED_ABOVE, _HALVED_ABOVE))
            image.load()
            small = _small(image)
            turn = _TURNS.get(_orientation(image))
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as err:
        raise SketchError(
            f"the picture is too large, each side must be {MIN_SIDE} to {MAX_SIDE} pixels"
        ) from err
    except _ERRORS as err:
        if isinstance(err, SketchError):
            raise
        raise SketchError(f"the picture is truncated or damaged: {err}") from err
    return _on_ground(small if turn is None else small.transpose(turn))


def _check_size(width: int, height: int) -> None:
    if not (MIN_SIDE <= width <= MAX_SIDE and MIN_SIDE <= height <= MAX_SIDE):
        raise SketchError(
            f"the picture is {width} x {height} pixels, each side must be {MIN_SIDE} to {MAX_SIDE}"
        )


def _orientation(image: Image.Image) -> int:
    """Return the orientation of a picture's EXIF data, as viewers read it: 1 where they are damaged."""
    exif = Image.Exif()
    with contextlib.suppress(*_ERRORS, Warning):
        exif.load(image.info.get("exif", b""))
        return int(exif.get(_ORIENTATION, 1))
    return 1


def _small(image: Image.Image) -> Image.Image:
    """Return a picture whose longer side has 512 pixels, with premultiplied colours."""
    width, height = image.size
    if max(width, height) > _HALVED_ABOVE:
        halved = Image.new("RGBa", ((width + 1) // 2, (height + 1) // 2))
        for top in range(0, height, _BAND):
            band = image.crop((0, top, width, min(top + _BAND, height)))
            halved.paste(_premultiplied(band, image).reduce(2), (0, top // 2))
    else:
        halved = _premultiplied(image, image)
    scale = RASTER_SIZE / max(width, height)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    smaller = max(halved.size) > RASTER_SIZE
    if halved.size == size:
        return halved
    return halved.resize(size, Image.Resampling.BOX if smaller else Image.Resampling.BILINEAR)


def _premultiplied(band: Image.Image, image: Image.Image) -> Image.Image:
    """Return a part of a picture of any mode in 8 bits, its colours times their opacity."""
    if band.mode.startswith("I"):
        # Pillow would clip numbers of 16 bits at 255.
        values = np.asarray(band).astype(np.uint32)
        grey = Image.fromarray(((values * 255 + 32_767) // 65_535).astype(np.uint8))
        hidden = image.info.get("transparency")
        seen = np.full(values.shape, 255, np.uint8) if hidden is None else (values != hidden) * np.uint8(255)
        band = Image.merge("LA", (grey, Image.fromarray(seen)))
    elif band.mode in {"CMYK", "YCbCr", "LAB", "HSV"}:
        band = band.convert("RGB")
    return band.convert("RGBA").convert("RGBa")


def _on_ground(small: Image.Image) -> tuple[npt.NDArray[np.uint8], str | None]:
    """Return a picture on white, or on black where its ink is white, in the middle of a square."""
    pixels = np.asarray(small).astype(np.int16)
    color, clear = pixels[..., :3], 255 - pixels[..., 3:]
    flat = color + clear
    if clear.any() and (255 - flat).max() < _FAINT:
        flat = color
    height, width = flat.shape[:2]
    if height == width:
        return np.ascontiguousarray(flat, dtype=np.uint8), None
    long = flat if width > height else flat.swapaxes(0, 1)
    before = (RASTER_SIZE - len(long)) // 2
    square = np.empty((RASTER_SIZE, RASTER_SIZE, 3), dtype=np.uint8)
    square[:before] = _ground(long[:_MARGIN])
    square[before : before + len(long)] = long
    square[before + len(long) :] = _ground(long[-_MARGIN:])
    if height > width:
        square = np.ascontiguousarray(square.swapaxes(0, 1))
    return square, (
        f"the picture is not square ({width} : {height}): its longer side spans the view, and it lies in the "
        "middle of the other"
    )


def _ground(edge: npt.NDArray[np.int16]) -> npt.NDArray[np.int16]:
    """Return the ground (512, 3) along an edge (K, 512, 3) of a picture, lit as it is there."""
    across = np.pad(np.median(edge, axis=0), ((_SPAN, _SPAN), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(across, 2 * _SPAN + 1, axis=0)
    return np.asarray(np.median(windows, axis=-1), dtype=np.int16)

"""Files that are no sketch, and pieces of ink: what is read, and what is refused."""

import io
import struct
import zlib
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from hybridmpm.control import Arrow, parse_png, render_png
from hybridmpm.control.sketch.ink import MAX_GAP, labels, main_mark
from hybridmpm.control.sketch.picture import MAX_BYTES
from hybridmpm.errors import SketchError

GOOD = render_png(Arrow([[0.2, 0.3], [0.6, 0.7]]))  # type: ignore[arg-type]


def _png(image: Image.Image, **options: object) -> bytes:
    data = io.BytesIO()
    image.save(data, "PNG", **options)
    return data.getvalue()


def _blank(width: int = 512, height: int = 512) -> Image.Image:
    return Image.new("RGB", (width, height), "white")


def _one_pixel_mark() -> bytes:
    image = _blank()
    image.putpixel((200, 200), (255, 0, 0))
    return _png(image)


def _saved(image: Image.Image, kind: str, **options: object) -> bytes:
    data = io.BytesIO()
    image.save(data, kind, **options)
    return data.getvalue()


RED = Image.new("RGB", (512, 512), "red")


def _jpeg_bomb() -> bytes:
    """Return a JPEG whose header says that it is 60000 x 60000."""
    data = bytearray(_saved(_blank(16, 16), "JPEG"))
    place = data.index(b"\xff\xc0") + 5
    data[place : place + 4] = struct.pack(">HH", 60000, 60000)
    return bytes(data)


def _bomb_header() -> bytes:
    """Return a file that says it is 60000 x 60000 and has nothing to show for it."""
    header = struct.pack(">IIBBBBB", 60000, 60000, 8, 6, 0, 0, 0)
    chunk = b"IHDR" + header
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))


def _text_bomb() -> bytes:
    """Return a small PNG whose compressed text chunk unpacks to 64 MiB."""
    text = b"zTXtnote\0\0" + zlib.compress(bytes(1 << 26))
    chunk = struct.pack(">I", len(text) - 4) + text + struct.pack(">I", zlib.crc32(text))
    return GOOD[:33] + chunk + GOOD[33:]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: b"", "no PNG, JPEG or WebP"),
        (lambda: b"GIF89a" + bytes(100), "no PNG, JPEG or WebP"),
        (lambda: b"RIFF\x10\0\0\0WEBPVP8 " + bytes(8), "truncated or damaged"),
        (lambda: _saved(_blank(), "JPEG")[:300], "truncated or damaged"),
        (lambda: _saved(_blank(), "JPEG").replace(b"\xff\xd9", b"\xff\xda" * 50), "scans"),
        (lambda: _saved(_blank(), "JPEG"), "blank"),
        (lambda: _saved(_blank(), "WEBP"), "blank"),
        (lambda: _saved(_blank(), "WEBP", save_all=True, append_images=[RED]), "animated"),
        (lambda: GOOD[:20], "truncated"),
        (lambda: GOOD[:400], "truncated or damaged"),
        (lambda: GOOD[:100] + bytes(200) + GOOD[300:], "truncated or damaged"),
        (lambda: GOOD + bytes(MAX_BYTES), f"at most {MAX_BYTES}"),
        (_bomb_header, "16 to 4096"),
        (_jpeg_bomb, "16 to 4096"),
        (_text_bomb, "truncated or damaged"),
        (lambda: _png(_blank(1, 1)), "16 to 4096"),
        (lambda: _png(_blank(5000, 100)), "16 to 4096"),
        (lambda: _png(_blank(4097, 4097)), "16 to 4096"),
        (lambda: _png(_blank(512, 256)), "blank"),
        (lambda: _png(_blank()), "blank"),
        (_one_pixel_mark, "1 drawn pixels.*at least 40"),
        (lambda: _png(Image.new("RGB", (512, 512), "red")), "blank"),
        (lambda: _png(Image.new("RGB", (512, 512), "black")), "blank"),
        (lambda: _png(_blank(), save_all=True, append_images=[RED]), "animated"),
    ],
)
def test_what_is_no_sketch_is_refused(make: Callable[[], bytes], message: str) -> None:
    with pytest.raises(SketchError, match=message):
        parse_png(make())


@pytest.mark.parametrize("mode", ["L", "LA", "P", "1", "I;16", "RGB", "RGBA"])
def test_every_kind_of_png_is_read_or_refused(mode: str) -> None:
    image = Image.new("RGB", (64, 64), "white")
    with pytest.raises(SketchError, match=r"blank|ink"):
        parse_png(_png(image.convert("L").convert(mode) if mode == "I;16" else image.convert(mode)))


@settings(max_examples=60, deadline=None)
@given(st.integers(8, len(GOOD) - 1), st.binary(min_size=1, max_size=8))
def test_damaged_files_never_raise_anything_else(where: int, noise: bytes) -> None:
    damaged = GOOD[:where] + noise + GOOD[where + len(noise) :]
    try:
        sketch = parse_png(damaged)
    except SketchError:
        return
    assert isinstance(sketch, Arrow)


def _flooded(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Return a number for each 8-connected piece of a mask, in the order of their first pixels."""
    result = np.zeros(mask.shape, dtype=np.int64)
    for start in np.argwhere(mask):
        if result[tuple(start)]:
            continue
        number, stack = int(result.max()) + 1, [tuple(start)]
        while stack:
            row, column = stack.pop()
            inside = 0 <= row < mask.shape[0] and 0 <= column < mask.shape[1]
            if inside and mask[row, column] and not result[row, column]:
                result[row, column] = number
                stack += [(row + down, column + right) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    return result


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.integers(1, 24), st.integers(1, 24))
def test_pieces_are_those_of_a_flood(seed: int, share: float, height: int, width: int) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < share
    assert np.array_equal(labels(mask), _flooded(mask))


def test_a_spiral_is_one_piece() -> None:
    turn = np.linspace(0, 40, 20_000)
    mask = np.zeros((512, 512), dtype=bool)
    mask[(256 + 6 * turn * np.sin(turn)).astype(int), (256 + 6 * turn * np.cos(turn)).astype(int)] = True
    assert labels(mask).max() == 1


@pytest.mark.parametrize("gap", [1, MAX_GAP - 1, MAX_GAP + 3])
def test_gaps_are_bridged_up_to_their_limit(gap: int) -> None:
    mask = np.zeros((512, 512), dtype=bool)
    mask[100:104, 50:150] = True
    mask[100:104, 150 + gap : 250 + gap] = True
    if gap > MAX_GAP:
        with pytest.raises(SketchError, match="without gaps wider than 12 pixels"):
            main_mark(mask)
    else:
        mark, bridged = main_mark(mask)
        assert np.array_equal(mark, mask)
        assert labels(bridged).max() == 1

"""One drawing in every kind of picture: each is read as the plain one is."""

import io
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFilter

from hybridmpm.control import Arrow, Ellipse, parse_png

TAIL, TIP = np.array([100, 412]) / 512, np.array([400, 152]) / 512
RED = (205, 40, 45)


def drawn(
    ink: object, ground: object = "white", mode: str = "RGB", size: tuple[int, int] = (512, 512)
) -> Image.Image:
    """Return an arrow from `TAIL` to `TIP` of the middle square of a picture."""
    scale = max(size)
    image = Image.new(mode, size, ground)
    pen = ImageDraw.Draw(image)
    left, top = (size[0] - scale) / 2, (size[1] - scale) / 2

    def line(*points: tuple[float, float]) -> None:
        placed = [(left + x / 512 * scale, top + y / 512 * scale) for x, y in points]
        pen.line(placed, fill=ink, width=round(8 / 512 * scale))

    line((100, 100), (400, 360))
    line((350, 360), (400, 360), (385, 310))
    return image


def saved(image: Image.Image, kind: str = "PNG", **options: object) -> bytes:
    data = io.BytesIO()
    image.save(data, kind, **options)
    return data.getvalue()


def check(data: bytes, note: str | None = None) -> None:
    sketch = parse_png(data)
    assert isinstance(sketch, Arrow)
    assert np.abs(sketch.points[0] - TAIL).max() < 0.02
    assert np.abs(sketch.points[-1] - TIP).max() < 0.02
    assert (note or "") in (sketch.note or "")
    assert (sketch.note is None) == (note is None)


def sixteen(image: Image.Image) -> Image.Image:
    return Image.fromarray(np.asarray(image).astype(np.uint16) * 257)


@pytest.mark.parametrize(("ink", "ground"), [(110, 255), (0, 255), (200, 40), (90, 160), (250, 0)])
def test_sixteen_bits_of_grey_are_read_as_eight(ink: int, ground: int) -> None:
    plain = drawn(ink, ground, "L")
    eight, wide = parse_png(saved(plain)), parse_png(saved(sixteen(plain)))
    assert isinstance(eight, Arrow)
    assert isinstance(wide, Arrow)
    assert np.array_equal(eight.points, wide.points)
    check(saved(sixteen(plain)))


def test_a_transparent_grey_of_sixteen_bits_is_white() -> None:
    image = sixteen(drawn(0, 77, "L"))
    check(saved(image, transparency=77 * 257))


TURNS = {
    1: None,
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_90,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_270,
}
"""What undoes the turn that each orientation asks for."""


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
@pytest.mark.parametrize("number", TURNS)
def test_orientation_is_as_viewers_show_it(number: int, kind: str) -> None:
    exif = Image.Exif()
    exif[0x0112] = number
    for size in ((512, 512), (640, 480)):
        image, turn = drawn("red", size=size), TURNS[number]
        data = saved(image if turn is None else image.transpose(turn), kind, exif=exif)
        check(data, None if size == (512, 512) else "not square (512 : 384)")


@pytest.mark.parametrize("exif", [b"", b"Exif\0\0", b"Exif\0\0MM\0*\0\0\0\x08\xff\xff", bytes(40)])
@pytest.mark.filterwarnings("ignore:Corrupt EXIF")
def test_damaged_orientation_is_none(exif: bytes) -> None:
    check(saved(drawn("red"), "JPEG", exif=exif))


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
@pytest.mark.parametrize("size", [(512, 384), (384, 512), (1600, 1300), (320, 240), (700, 699)])
def test_any_shape_is_fitted_and_said(size: tuple[int, int], kind: str) -> None:
    check(saved(drawn("red", (230, 225, 210), size=size), kind), "not square")


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        ("PNG", "RGBA"),
        ("PNG", "P"),
        ("PNG", "L"),
        ("PNG", "1"),
        ("JPEG", "RGB"),
        ("JPEG", "CMYK"),
        ("WEBP", "RGB"),
    ],
)
@pytest.mark.parametrize("side", [300, 2049, 4096])
def test_sizes_and_modes(kind: str, mode: str, side: int) -> None:
    check(saved(drawn("black", size=(side, side)).convert(mode), kind))


@pytest.mark.parametrize("side", [512, 3000])
@pytest.mark.parametrize("ink", ["white", "black", "red", (250, 250, 240)])
def test_ink_on_transparency_is_seen(ink: object, side: int) -> None:
    image = drawn(ink, (0, 0, 0, 0), "RGBA", (side, side))
    check(saved(image))
    check(saved(image, "WEBP", lossless=True))


LIGHTS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "from the side": lambda x, _: 0.35 + 0.65 * x,
    "from a corner": lambda x, y: 0.4 + 0.3 * (x + y),
    "vignette": lambda x, y: 1 - 0.9 * ((x - 0.5) ** 2 + (y - 0.5) ** 2),
    "soft shadow": lambda x, y: 1 - 0.5 / (1 + np.exp((y - x) * 18)),
    "hand": lambda x, y: 1 - 0.55 * np.exp(-(((x - 0.8) / 0.3) ** 2 + ((y - 0.9) / 0.25) ** 2)),
}


@pytest.mark.parametrize("paper", [(235, 235, 235), (240, 225, 190), (250, 215, 160), (200, 215, 235)])
@pytest.mark.parametrize("light", LIGHTS)
def test_ink_on_photographed_paper(light: str, paper: tuple[int, int, int]) -> None:
    y, x = np.mgrid[0:512, 0:512] / 512
    bright = LIGHTS[light](x, y)[..., None]

    def photographed(image: Image.Image) -> bytes:
        soft = np.asarray(image.filter(ImageFilter.GaussianBlur(0.8))).astype(float) * bright
        noisy = soft + np.random.default_rng(1).normal(0, 4, soft.shape)
        return saved(Image.fromarray(np.clip(noisy, 0, 255).astype(np.uint8)), "JPEG", quality=80)

    check(photographed(drawn(RED, paper)))
    check(photographed(drawn((40, 40, 50), paper)))
    oval = Image.new("RGB", (512, 512), paper)
    ImageDraw.Draw(oval).ellipse([150, 130, 380, 320], outline=(30, 150, 60), width=7)
    sketch = parse_png(photographed(oval))
    assert isinstance(sketch, Ellipse)
    assert np.abs(sketch.center - np.array([265, 287]) / 512).max() < 0.01

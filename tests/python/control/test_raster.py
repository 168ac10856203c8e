"""What `render_png` draws, `parse_png` reads back; and it reads what others draw, in any kind of picture."""

import io
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw, ImageFilter

from hybridmpm.control import Arrow, Ellipse, parse_png, render_png
from hybridmpm.control.sketch.polyline import distance_to_line, evenly_spaced
from hybridmpm.control.sketch.render import OUTLINE_WIDTH, RED, render
from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.errors import SketchError

PIXEL = 1 / 512
DEPTH = 0.05 * 18
"""A twentieth of the depth between the walls, as a difference of widths [pixels]."""
width = st.floats(2, 20)


@st.composite
def straight(draw: st.DrawFn, shortest: float) -> Floats:
    """Draw tail and tip, `shortest` to 300 pixels apart in any direction, inside the picture."""
    tail = np.array([draw(st.floats(0.1, 0.9)), draw(st.floats(0.1, 0.9))])
    direction, pixels = draw(st.floats(0, 2 * np.pi)), draw(st.floats(shortest, 300))
    points = np.array([tail, tail + pixels * PIXEL * np.array([np.cos(direction), np.sin(direction)])])
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(points + np.maximum(0.1 - low, 0) - np.maximum(high - 0.9, 0))


@st.composite
def bent(draw: st.DrawFn) -> Arrow:
    """Draw an arrow of two or three segments of 100 to 140 pixels, with a width at each point."""
    count = draw(st.integers(2, 3))
    turns = [draw(st.floats(0.4, 1.2)) * draw(st.sampled_from([-1, 1])) for _ in range(count - 1)]
    directions = draw(st.floats(0, 2 * np.pi)) + np.cumsum([0.0, *turns])
    lengths = np.array([draw(st.floats(100, 140)) for _ in range(count)]) * PIXEL
    steps = np.column_stack([np.cos(directions), np.sin(directions)]) * lengths[:, None]
    points = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    # Anywhere in the picture.
    low, high = 0.06 - points.min(axis=0), 0.94 - points.max(axis=0)
    points += low + np.array([draw(st.floats(0, 1)), draw(st.floats(0, 1))]) * (high - low)
    return Arrow(points, np.array([draw(st.floats(3, 14)) for _ in points]))


@st.composite
def ellipses(draw: st.DrawFn) -> Ellipse:
    """Draw an ellipse that lies inside the picture, with a line up to as thick as its smaller semi-axis."""
    major, ratio = draw(st.floats(0.06, 0.3)), draw(st.floats(0.4, 1.0))
    center = np.array([draw(st.floats(0.02 + major, 0.98 - major)) for _ in range(2)])
    thickness = draw(st.none() | st.floats(2, min(20.0, ratio * major / PIXEL)))
    return Ellipse(center, np.array([major, ratio * major]), draw(st.floats(-1.5, 1.5)), thickness)


def _degrees_between(a: Floats, b: Floats) -> float:
    cosine = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(min(cosine, 1.0))))


@settings(max_examples=20, deadline=None)
@given(straight(60))
def test_an_arrow_comes_back(points: Floats) -> None:
    read = parse_png(render_png(Arrow(points)))
    assert _degrees_between(read.displacement, points[1] - points[0]) < 2
    np.testing.assert_allclose(read.points[[0, -1]], points, atol=1.5 * PIXEL)


@settings(max_examples=20, deadline=None)
@given(straight(130), width, width)
def test_the_depth_of_an_arrow_comes_back(points: Floats, start: float, end: float) -> None:
    read = parse_png(render_png(Arrow(points, np.array([start, end]))))
    assert isinstance(read, Arrow)
    assert _degrees_between(read.displacement, points[1] - points[0]) < 2
    np.testing.assert_allclose(read.points[[0, -1]], points, atol=2 * PIXEL)
    np.testing.assert_allclose(read.widths[[0, -1]], [start, end], atol=DEPTH)


@settings(max_examples=20, deadline=None)
@given(bent())
# Thick lines that come in thin: much of the small head counted as line, and was lost. The tip of the second
# was taken for a round end, 3.7 pixels behind the point.
@example(Arrow(np.array([[0.484, 0.181], [0.673, 0.279], [0.851, 0.194]]), np.array([8.9, 12.0, 3.9])))
@example(Arrow(np.array([[0.622, 0.661], [0.663, 0.447], [0.895, 0.355]]), np.array([12.6, 12.1, 5.6])))
# The way to the tip went along the back of the head, whose ink was taken for the line.
@example(
    Arrow(np.array([[0.06, 0.06], [0.2553125, 0.06], [0.35187886, 0.24972969]]), np.array([5.0, 11.0, 10.0]))
)
# The thick end of the line looked like a head, because the head was thought to be as thick a line.
@example(Arrow(np.array([[0.45416959, 0.65648534], [0.9, 0.47999737]]), np.array([18.0, 2.0])))
@example(Arrow(np.array([[0.49, 0.646], [0.1, 0.6]]), np.array([14.5, 4.3])))
def test_a_bent_arrow_comes_back_with_its_bends_and_depths(drawn: Arrow) -> None:
    read = parse_png(render_png(drawn))
    assert isinstance(read, Arrow)
    np.testing.assert_allclose(read.points[[0, -1]], drawn.points[[0, -1]], atol=2 * PIXEL)
    # The head hides the end of the last segment, whose width is extrapolated from what is left of it; the
    # worst width found so far is off by 1.6 depths.
    np.testing.assert_allclose(read.widths[[0, -1]], drawn.widths[[0, -1]], atol=2 * DEPTH)
    there, back = (
        distance_to_line(evenly_spaced(one.points, 200), other.points).max()
        for one, other in ((read, drawn), (drawn, read))
    )
    assert max(there, back) < 3 * PIXEL


@settings(max_examples=20, deadline=None)
@given(ellipses())
def test_an_ellipse_comes_back(drawn: Ellipse) -> None:
    read = parse_png(render_png(drawn))
    assert isinstance(read, Ellipse)
    np.testing.assert_allclose(read.center, drawn.center, atol=PIXEL)
    np.testing.assert_allclose(read.axes, drawn.axes, atol=2.5 * PIXEL)
    if drawn.axes[1] < 0.9 * drawn.axes[0]:
        assert abs((read.angle - drawn.angle + np.pi / 2) % np.pi - np.pi / 2) < np.radians(2)
    assert read.width == pytest.approx(drawn.width or OUTLINE_WIDTH, abs=DEPTH)


def test_a_picture_has_the_size_the_colours_and_the_width_that_are_documented() -> None:
    picture = render(Arrow(np.array([[0.2, 0.5], [0.8, 0.5]]), np.array([20.0, 2.0])))
    assert picture.shape == (512, 512, 4)
    assert picture[0, 0].tolist() == [255, 255, 255, 255]
    assert picture[255, 130].tolist() == [*RED, 255]
    ink = (255 - picture[..., 1]).astype(float) / (255 - RED[1])
    # At the tail's side of the middle, where the width falls by 18 pixels over 307.
    assert ink[:, 200].sum() == pytest.approx(20 - 18 * (200.5 - 102.4) / 307.2, abs=0.1)


def _picture(size: int = 512, ground: tuple[int, ...] = (255, 255, 255, 255)) -> Image.Image:
    return Image.new("RGBA", (size, size), ground)


def _png(image: Image.Image) -> bytes:
    data = io.BytesIO()
    image.save(data, "PNG")
    return data.getvalue()


def test_a_dark_outline_with_a_small_gap_is_an_ellipse() -> None:
    image = _picture()
    ImageDraw.Draw(image).arc((150, 200, 350, 320), start=10, end=350, fill="black", width=4)
    read = parse_png(_png(image))
    assert isinstance(read, Ellipse)
    np.testing.assert_allclose(read.center, [250 / 512, 252 / 512], atol=8 * PIXEL)


def test_dust_does_not_make_a_second_sketch() -> None:
    image = Image.open(io.BytesIO(render_png(Arrow(np.array([[0.2, 0.2], [0.7, 0.6]])))))
    for x in range(20, 500, 60):
        image.putpixel((x, 20), (200, 0, 0, 255))
        image.putpixel((x, 500), (0, 200, 0, 255))
    assert isinstance(parse_png(_png(image)), Arrow)


def test_a_line_without_a_head_has_no_direction() -> None:
    image = _picture()
    ImageDraw.Draw(image).line((100, 100, 400, 300), fill="red", width=4)
    with pytest.raises(SketchError, match="head"):
        parse_png(_png(image))


def test_red_and_green_together_are_two_sketches() -> None:
    image = Image.open(io.BytesIO(render_png(Arrow(np.array([[0.2, 0.2], [0.5, 0.2]])))))
    ImageDraw.Draw(image).ellipse((300, 100, 400, 200), outline=(80, 200, 80, 255), width=3)
    with pytest.raises(SketchError, match="red and green"):
        parse_png(_png(image))


@pytest.mark.parametrize(
    ("one", "other", "message"),
    [
        (([0.1, 0.1], [0.4, 0.1]), ([0.1, 0.5], [0.4, 0.6]), "several separate marks"),
        (([0.1, 0.1], [0.6, 0.6]), ([0.1, 0.6], [0.6, 0.1]), "head looks like its tail"),
        (([0.5, 0.5], [0.8, 0.6]), ([0.5, 0.5], [0.2, 0.6]), "other lines beside it"),
        (([0.1, 0.1], [0.4, 0.1]), ([0.4, 0.1], [0.8, 0.2]), "other lines beside it"),
        (([0.1, 0.5], [0.5, 0.5]), ([0.3, 0.5], [0.3, 0.2]), "other lines beside it"),
    ],
)
def test_two_arrows_are_too_many(one: list[list[float]], other: list[list[float]], message: str) -> None:
    arrows = [render(Arrow(np.array(points))) for points in (one, other)]
    with pytest.raises(SketchError, match=message):
        parse_png(_png(Image.fromarray(np.minimum(*arrows))))


@pytest.mark.parametrize(
    ("one", "other", "message"),
    [
        ((0.3, 0.3, 0.1, 0.1), (0.7, 0.7, 0.1, 0.1), "several separate marks"),
        ((0.4, 0.5, 0.2, 0.1), (0.6, 0.5, 0.2, 0.1), "no oval.*lies off the ellipse"),
    ],
)
def test_two_ovals_are_too_many(one: list[float], other: list[float], message: str) -> None:
    ovals = [render(Ellipse(np.array(oval[:2]), np.array(oval[2:]), 0.0)) for oval in (one, other)]
    with pytest.raises(SketchError, match=message):
        parse_png(_png(Image.fromarray(np.minimum(*ovals))))


@pytest.mark.parametrize("pixels", [10, 25, 40])
def test_a_short_arrow_is_refused_with_the_least_length(pixels: int) -> None:
    with pytest.raises(SketchError, match=r"too short.*at least 50 pixels"):
        parse_png(render_png(Arrow(np.array([[0.5, 0.5], [0.5 + pixels * PIXEL, 0.5]]))))


def test_a_wide_open_outline_is_refused_with_the_gap() -> None:
    image = _picture()
    ImageDraw.Draw(image).arc((150, 150, 350, 350), start=0, end=250, fill=(80, 200, 80, 255), width=4)
    with pytest.raises(SketchError, match=r"not closed.*10[0-9] degrees.*at most 70"):
        parse_png(_png(image))


def test_an_oval_partly_outside_is_read_as_far_as_its_opening_allows() -> None:
    """Its line inside of the picture tells where the rest lies; with less of it, nobody knows."""
    read = parse_png(render_png(Ellipse(np.array([0.85, 0.5]), np.array([0.17, 0.1]), 0.0)))
    assert isinstance(read, Ellipse)
    np.testing.assert_allclose(read.center, [0.85, 0.5], atol=2 * PIXEL)
    with pytest.raises(SketchError, match="not closed"):
        parse_png(render_png(Ellipse(np.array([0.95, 0.5]), np.array([0.2, 0.1]), 0.0)))


def test_a_filled_oval_is_refused() -> None:
    image = _picture()
    ImageDraw.Draw(image).ellipse((150, 150, 350, 300), fill=(0, 200, 0, 255))
    with pytest.raises(SketchError, match="filled"):
        parse_png(_png(image))


def _scribble(color: str, corners: int) -> bytes:
    image, rng = _picture(), np.random.default_rng(3)
    line = [(float(x), float(y)) for x, y in rng.uniform(50, 450, (corners, 2))]
    ImageDraw.Draw(image).line(line, fill=color, width=3)
    return _png(image)


def _noise(share: float, color: tuple[int, int, int]) -> bytes:
    picture = np.full((512, 512, 3), 255, dtype=np.uint8)
    picture[np.random.default_rng(0).random((512, 512)) < share] = color
    return _png(Image.fromarray(picture))


def _photograph(channels: int) -> bytes:
    """Return a picture with the spectrum of a photograph, whose amplitudes fall with the frequency."""
    rng = np.random.default_rng(1)
    frequency = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256)) + 1e-3
    fields = [
        np.fft.irfft2(np.fft.rfft2(rng.normal(size=(256, 256))) / frequency**1.5) for _ in range(channels)
    ]
    values = np.stack((fields * 3)[:3], axis=-1)
    scaled = 255 * (values - values.min()) / np.ptp(values)
    return _png(Image.fromarray(scaled.astype(np.uint8)))


def _maze() -> bytes:
    """Return one line of 66 000 pixels."""
    image = _picture()
    pen = ImageDraw.Draw(image)
    for row in range(0, 508, 4):
        pen.line((2, row, 508, row), fill="red")
        side = 508 if row % 8 else 2
        pen.line((side, row, side, row + 4), fill="red")
    return _png(image)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (partial(_noise, 0.01, (220, 0, 0)), "separate marks.*at most 8 pieces"),
        (partial(_noise, 0.45, (0, 0, 0)), "is ink, at most 30%"),
        (partial(_photograph, 3), "red and green"),
        (partial(_photograph, 1), "separate marks"),
        (partial(_scribble, "green", 30), "no oval|filled"),
        (partial(_scribble, "red", 30), "head looks like its tail|other lines|too long"),
        (_maze, "too long.*up to 2048"),
    ],
)
def test_what_shows_no_sketch_is_refused(make: Callable[[], bytes], message: str) -> None:
    with pytest.raises(SketchError, match=message):
        parse_png(make())


@settings(max_examples=15, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(2, 8),
    st.integers(1, 12),
    st.sampled_from(["red", "green", "black"]),
)
def test_lines_of_any_kind_are_read_or_refused(seed: int, corners: int, thick: int, color: str) -> None:
    image, rng = _picture(), np.random.default_rng(seed)
    line = [(float(x), float(y)) for x, y in rng.uniform(-20, 532, (corners, 2))]
    ImageDraw.Draw(image).line(line, fill=color, width=thick)
    try:
        read = parse_png(_png(image))
    except SketchError:
        return
    assert isinstance(read, Arrow | Ellipse)


TAIL, TIP = np.array([100, 412]) / 512, np.array([400, 152]) / 512
INK = (205, 40, 45)


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
    """What lies beside a picture that is not square is lit as its edges are."""
    y, x = np.mgrid[0:512, 0:512] / 512
    bright = LIGHTS[light](x, y)[..., None]

    def photographed(image: Image.Image) -> bytes:
        soft = np.asarray(image.filter(ImageFilter.GaussianBlur(0.8))).astype(float) * bright
        noisy = soft + np.random.default_rng(1).normal(0, 4, soft.shape)
        return saved(Image.fromarray(np.clip(noisy, 0, 255).astype(np.uint8)), "JPEG", quality=80)

    check(photographed(drawn(INK, paper)))
    check(photographed(drawn((40, 40, 50), paper)))
    for ink in (INK, (40, 40, 50), (30, 60, 160)):
        wide = Image.fromarray(np.asarray(drawn(ink, paper))[40:424])
        bright = bright[40:424] if len(bright) == 512 else bright
        sketch = parse_png(photographed(wide))
        assert isinstance(sketch, Arrow)
        assert np.abs(sketch.points[0] - TAIL - np.array([0, -24 / 512])).max() < 0.02
        assert np.abs(sketch.points[-1] - TIP - np.array([0, -24 / 512])).max() < 0.02
    bright = LIGHTS[light](x, y)[..., None]
    oval = Image.new("RGB", (512, 512), paper)
    ImageDraw.Draw(oval).ellipse([150, 130, 380, 320], outline=(30, 150, 60), width=7)
    sketch = parse_png(photographed(oval))
    assert isinstance(sketch, Ellipse)
    assert np.abs(sketch.center - np.array([265, 287]) / 512).max() < 0.01

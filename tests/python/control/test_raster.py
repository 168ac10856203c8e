"""What `render_png` draws, `parse_png` reads back; and it reads what others draw."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from hybridmpm.control import Arrow, Ellipse, parse_png, render_png
from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.errors import SketchError

PIXEL = 1 / 512
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
def ellipses(draw: st.DrawFn) -> Ellipse:
    """Draw an ellipse that lies inside the picture."""
    center = np.array([draw(st.floats(0.35, 0.65)), draw(st.floats(0.35, 0.65))])
    major, ratio = draw(st.floats(0.06, 0.3)), draw(st.floats(0.5, 0.95))
    thickness = draw(st.none() | st.floats(2, 12))
    return Ellipse(center, np.array([major, ratio * major]), draw(st.floats(-1.5, 1.5)), thickness)


def _degrees_between(a: Floats, b: Floats) -> float:
    cosine = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(min(cosine, 1.0))))


@settings(max_examples=30, deadline=None)
@given(straight(60))
def test_an_arrow_comes_back(points: Floats) -> None:
    read = parse_png(render_png(Arrow(points)))
    assert isinstance(read, Arrow)
    assert _degrees_between(read.displacement, points[1] - points[0]) < 3
    np.testing.assert_allclose(read.points[[0, -1]], points, atol=4 * PIXEL)


@settings(max_examples=30, deadline=None)
@given(straight(130), width, width)
def test_the_depth_of_an_arrow_comes_back(points: Floats, start: float, end: float) -> None:
    read = parse_png(render_png(Arrow(points, np.array([start, end]))))
    assert isinstance(read, Arrow)
    assert read.widths is not None
    assert _degrees_between(read.displacement, points[1] - points[0]) < 5
    np.testing.assert_allclose(read.points[0], points[0], atol=5 * PIXEL)
    np.testing.assert_allclose(read.points[-1], points[1], atol=10 * PIXEL)
    np.testing.assert_allclose(read.widths[[0, -1]], [start, end], atol=3)


@settings(max_examples=20, deadline=None)
@given(ellipses())
def test_an_ellipse_comes_back(drawn: Ellipse) -> None:
    read = parse_png(render_png(drawn))
    assert isinstance(read, Ellipse)
    np.testing.assert_allclose(read.center, drawn.center, atol=PIXEL)
    np.testing.assert_allclose(read.axes, drawn.axes, atol=3 * PIXEL)
    if drawn.axes[1] < 0.85 * drawn.axes[0]:
        assert abs((read.angle - drawn.angle + np.pi / 2) % np.pi - np.pi / 2) < 0.05
    if drawn.width is not None:
        assert read.width == pytest.approx(drawn.width, abs=2)


def test_a_bent_arrow_keeps_its_bend() -> None:
    drawn = Arrow(np.array([[0.2, 0.2], [0.6, 0.3], [0.7, 0.7]]))
    read = parse_png(render_png(drawn))
    assert isinstance(read, Arrow)
    distance = np.linalg.norm(read.points - [0.6, 0.3], axis=1).min()
    assert distance < 10 * PIXEL
    np.testing.assert_allclose(read.displacement, drawn.displacement, atol=6 * PIXEL)


def _picture(size: int = 512, ground: tuple[int, ...] = (255, 255, 255, 255)) -> Image.Image:
    return Image.new("RGBA", (size, size), ground)


def _png(image: Image.Image) -> bytes:
    data = io.BytesIO()
    image.save(data, "PNG")
    return data.getvalue()


def _draw_pencil_arrow(image: Image.Image, color: str) -> None:
    scale = image.width / 512
    pen = ImageDraw.Draw(image)
    for line in ((100, 400, 300, 200), (300, 200, 262, 212), (300, 200, 288, 238)):
        pen.line([scale * value for value in line], fill=color, width=max(1, round(4 * scale)))


@pytest.mark.parametrize("color", ["black", "blue", "darkred"])
@pytest.mark.parametrize("ground", [(255, 255, 255, 255), (0, 0, 0, 0)])
@pytest.mark.parametrize("size", [200, 512, 1500])
def test_a_hand_drawn_arrow_is_read_in_any_size_and_on_transparent_ground(
    color: str, ground: tuple[int, ...], size: int
) -> None:
    image = _picture(size, ground)
    _draw_pencil_arrow(image, color)
    read = parse_png(_png(image))
    assert isinstance(read, Arrow)
    np.testing.assert_allclose(read.points[0], [100 / 512, 112 / 512], atol=8 * PIXEL)
    np.testing.assert_allclose(read.points[-1], [300 / 512, 312 / 512], atol=8 * PIXEL)


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


def test_two_arrows_are_too_many() -> None:
    image = _picture()
    pen = ImageDraw.Draw(image)
    pen.line((50, 50, 200, 50), fill="red", width=4)
    pen.line((50, 300, 200, 300), fill="red", width=4)
    with pytest.raises(SketchError, match="several separate marks"):
        parse_png(_png(image))


def test_a_wide_open_outline_is_refused_with_the_gap() -> None:
    image = _picture()
    ImageDraw.Draw(image).arc((150, 150, 350, 350), start=0, end=200, fill=(80, 200, 80, 255), width=4)
    with pytest.raises(SketchError, match=r"not closed.*20%"):
        parse_png(_png(image))

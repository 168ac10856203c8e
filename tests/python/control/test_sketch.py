"""Arrows and ellipses check themselves, and widths stand for depth."""

import numpy as np
import pytest

from hybridmpm.control import Arrow, Ellipse
from hybridmpm.control.sketch.sketch import MAX_POINTS, depth_of_width
from hybridmpm.errors import SketchError


@pytest.mark.parametrize(
    ("points", "widths", "message"),
    [
        ([[0.1, 0.2]], None, "2 to 4096"),
        (np.full((MAX_POINTS + 1, 2), 0.5), None, "2 to 4096"),
        ([[0.1, 0.2], [np.nan, 0.2]], None, r"points\[1\].*\[0, 1\]"),
        ([[0.1, 0.2], [0.1, np.inf]], None, r"points\[1\].*\[0, 1\]"),
        ([[-0.01, 0.2], [0.1, 0.2]], None, r"points\[0\].*\[0, 1\]"),
        ([[0.1, 0.2], [0.1, 1.01]], None, r"points\[1\].*\[0, 1\]"),
        ([[0.5, 0.5], [0.5, 0.5]], None, "at least 0.0039"),
        ([[0.1, 0.2, 0.3], [0.3, 0.2, 0.3]], None, r"\(K, 2\)"),
        ("words", None, "numbers"),
        ([[0.1, 0.2], [0.3, 0.2]], [4.0], r"one number per point \(2\)"),
        ([[0.1, 0.2], [0.3, 0.2]], [1.0, 4.0], r"\[2, 20\]"),
        ([[0.1, 0.2], [0.3, 0.2]], [4.0, np.nan], r"\[2, 20\]"),
    ],
)
def test_a_bad_arrow_is_refused_with_field_and_range(points: object, widths: object, message: str) -> None:
    with pytest.raises(SketchError, match=message):
        Arrow(points, widths)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("center", "axes", "angle", "width", "message"),
    [
        ([0.5, 1.5], [0.2, 0.1], 0.0, None, r"center.*\[0, 1\]"),
        ([0.5, 0.5], [0.2, 0.0], 0.0, None, "axes"),
        ([0.5, 0.5], [np.nan, 0.1], 0.0, None, "axes"),
        ([0.5, 0.5], [0.2, 0.1], np.inf, None, "angle"),
        ([0.5, 0.5], [0.2, 0.1], 0.0, 21.0, r"\[2, 20\]"),
    ],
)
def test_a_bad_ellipse_is_refused_with_field_and_range(
    center: list[float], axes: list[float], angle: float, width: float | None, message: str
) -> None:
    with pytest.raises(SketchError, match=message):
        Ellipse(np.array(center), np.array(axes), angle, width)


def test_a_checked_sketch_cannot_be_changed_afterwards() -> None:
    points = np.array([[0.1, 0.2], [0.4, 0.6]])
    arrow = Arrow(points)
    points[0] = 7.0
    assert arrow.points[0].tolist() == [0.1, 0.2]
    with pytest.raises(ValueError, match="read-only"):
        arrow.points[0, 0] = 0.5


def test_depth_is_linear_between_the_walls_and_stays_between_them() -> None:
    depths = [depth_of_width(width, 0.1, 0.9) for width in (0.0, 2.0, 11.0, 20.0, 40.0)]
    np.testing.assert_allclose(depths, [0.1, 0.1, 0.5, 0.9, 0.9])

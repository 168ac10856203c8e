"""Sketches drawn as by hand are read as what was meant, from the picture and from the recorded stroke.

What a hand draws is not what it means: tremor, a head beside the end of its shaft and an opening shift both
readings alike. So the tolerances are those of the hand; how exact the readers are says test_raster.py.
"""

from typing import Any

import numpy as np
import pytest
from tests.python.control.hand_drawn import SKETCHES, pictures

from hybridmpm.control import Arrow, Ellipse, Sketch, classify_stroke, parse_png, parse_strokes, render_png
from hybridmpm.control.sketch.polyline import distance_to_line, evenly_spaced

PIXEL = 1 / 512
END = 8 * PIXEL
"""Largest distance of an arrow's tail from the meant one [m]."""
TIP = 11 * PIXEL
"""Largest distance of its tip, where the head may stand up to 8 pixels before the shaft."""
WAY = 12 * PIXEL
"""Largest distance of any place of its line, whose corners a hand cuts."""
CENTER = (2 * PIXEL, 0.02)
"""Largest distance of an oval's centre: a length [m], and a fraction of the major semi-axis."""
AXES = 0.1
"""Largest relative error of its semi-axes."""
ANGLE = np.radians(6)
"""Largest error of its angle, where the smaller axis is at most 0.8 times the other."""
DEPTH = 0.1 * 18
"""Largest error of a width: a tenth of the depth between the walls [pixels]. Pens press unevenly."""


def _recorded(drawn: Any, **more: Any) -> dict[str, Any]:
    stroke = drawn.stroke
    return {"points": stroke.points.tolist(), "widths": stroke.widths, "times": stroke.times} | more


def _check(read: Sketch, meant: Sketch) -> None:
    if isinstance(meant, Arrow):
        assert isinstance(read, Arrow)
        _check_arrow(read, meant)
    else:
        assert isinstance(read, Ellipse)
        _check_ellipse(read, meant)


def _check_arrow(read: Arrow, meant: Arrow) -> None:
    assert np.linalg.norm(read.points[0] - meant.points[0]) < END
    assert np.linalg.norm(read.points[-1] - meant.points[-1]) < TIP
    there, back = (
        distance_to_line(evenly_spaced(one.points, 200), other.points).max()
        for one, other in ((read, meant), (meant, read))
    )
    assert max(there, back) < WAY
    if meant.widths is not None:
        np.testing.assert_allclose(read.widths[[0, -1]], meant.widths[[0, -1]], atol=DEPTH)


def _check_ellipse(read: Ellipse, meant: Ellipse) -> None:
    assert np.linalg.norm(read.center - meant.center) < CENTER[0] + CENTER[1] * meant.axes[0]
    np.testing.assert_allclose(read.axes, meant.axes, rtol=AXES)
    if meant.axes[1] < 0.8 * meant.axes[0]:
        assert abs((read.angle - meant.angle + np.pi / 2) % np.pi - np.pi / 2) < ANGLE
    if meant.width is not None:
        assert read.width == pytest.approx(meant.width, abs=DEPTH)


def test_there_are_enough_of_each_kind() -> None:
    kinds = [sketch.meant.kind for sketch in SKETCHES]
    assert len(SKETCHES) >= 30
    assert min(kinds.count("arrow"), kinds.count("ellipse")) >= 15


@pytest.mark.parametrize("drawn", SKETCHES)
def test_a_drawing_is_read_as_what_was_meant(drawn: Any) -> None:
    _check(parse_png(render_png(drawn.drawing)), drawn.meant)


@pytest.mark.parametrize("drawn", SKETCHES)
def test_a_recorded_stroke_is_read_as_what_was_meant(drawn: Any) -> None:
    assert classify_stroke(drawn.stroke.points) == drawn.meant.kind
    _check(parse_strokes([_recorded(drawn)]), drawn.meant)


def test_a_picture_from_paper_is_read_as_what_was_meant() -> None:
    for drawn, data in zip(SKETCHES, pictures(), strict=False):
        _check(parse_png(data), drawn.meant)


def test_a_stroke_records_times_at_a_pens_speed() -> None:
    for drawn in SKETCHES:
        steps = np.diff(drawn.stroke.times)
        assert (steps > 0).all()
        speed = np.hypot(*np.diff(drawn.stroke.points, axis=0).T).sum() / drawn.stroke.times[-1]
        assert 0.3 < speed < 0.8

"""The vector form: one stroke becomes an arrow or an ellipse."""

from typing import Any

import numpy as np
import pytest

from hybridmpm.control import Arrow, Ellipse, Stroke, parse_strokes
from hybridmpm.errors import SketchError

ARROW: dict[str, Any] = {"points": [[0.3, 0.5], [0.6, 0.7]]}


def _oval(count: int = 200, *, turn: float = 2 * np.pi) -> list[list[float]]:
    angle = np.linspace(0.0, turn, count)
    local = np.column_stack([0.2 * np.cos(angle), 0.1 * np.sin(angle)])
    tilt = np.pi / 6
    rotation = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
    points: list[list[float]] = (np.array([0.5, 0.4]) + local @ rotation.T).tolist()
    return points


def test_an_open_stroke_is_an_arrow_with_its_widths() -> None:
    sketch = parse_strokes([ARROW | {"widths": [4, 9], "times": [0.0, 0.4]}])
    assert isinstance(sketch, Arrow)
    assert sketch.points.tolist() == ARROW["points"]
    assert sketch.widths is not None
    assert sketch.widths.tolist() == [4, 9]


def test_a_stroke_model_is_as_good_as_a_mapping() -> None:
    sketch = parse_strokes([Stroke(points=[(0.3, 0.5), (0.6, 0.7)])])
    assert isinstance(sketch, Arrow)


def test_a_closed_stroke_is_the_ellipse_it_follows() -> None:
    sketch = parse_strokes([{"points": _oval()}])
    assert isinstance(sketch, Ellipse)
    np.testing.assert_allclose(sketch.center, [0.5, 0.4], atol=1e-6)
    np.testing.assert_allclose(sketch.axes, [0.2, 0.1], rtol=1e-3)
    assert sketch.angle == pytest.approx(np.pi / 6, abs=1e-3)


def test_where_the_pen_rests_does_not_move_the_ellipse() -> None:
    points = _oval()
    resting = points[:50] + [points[50]] * 500 + points[51:]
    sketch = parse_strokes([{"points": resting}])
    assert isinstance(sketch, Ellipse)
    np.testing.assert_allclose(sketch.center, [0.5, 0.4], atol=1e-3)


def test_the_kind_can_be_said() -> None:
    assert isinstance(parse_strokes([{"points": _oval(), "kind": "arrow"}]), Arrow)
    assert isinstance(parse_strokes([{"points": _oval(turn=4.5), "kind": "ellipse"}]), Ellipse)


@pytest.mark.parametrize(
    ("strokes", "message"),
    [
        ([], "exactly 1, got 0"),
        ([ARROW, ARROW], "exactly 1, got 2"),
        ("strokes", "list of one stroke"),
        ([{"points": [[0.3, 0.5]]}], r"strokes\[0\]\.points.*at least 2"),
        ([{"points": [[0.3, 0.5]] * 4097}], r"strokes\[0\]\.points.*at most 4096"),
        ([{"points": [[0.3, float("nan")], [0.5, 0.5]]}], r"strokes\[0\]\.points\[0\]\[1\]"),
        ([{"points": [[0.3, 1.5], [0.5, 0.5]]}], r"points\[0\]\[1\].*less than or equal to 1"),
        ([{"points": [[0.3, 0.5], [0.3, 0.5]]}], r"strokes\[0\]\.points.*at least"),
        ([ARROW | {"widths": [4]}], "one per point"),
        ([ARROW | {"widths": [4, 50]}], r"widths\[1\].*less than or equal to 20"),
        ([ARROW | {"times": [1.0, 0.5]}], "not decrease"),
        ([ARROW | {"kind": "square"}], "'arrow' or 'ellipse'"),
        ([ARROW | {"color": "red"}], "color"),
        ([{"points": [[0.2, 0.2], [0.4, 0.4], [0.6, 0.6]], "kind": "ellipse"}], "enclose an area"),
        ([None], r"strokes\[0\]"),
    ],
)
def test_bad_strokes_are_refused_with_field_and_range(strokes: Any, message: str) -> None:
    with pytest.raises(SketchError, match=message):
        parse_strokes(strokes)

"""The vector form: one stroke becomes an arrow or an ellipse, which check themselves."""

from typing import Any

import numpy as np
import pytest

from hybridmpm.control import Arrow, Ellipse, Stroke, classify_stroke, parse_strokes
from hybridmpm.control.sketch.sketch import MAX_POINTS, depth_of_width
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


def _around(turn: float, *, ratio: float = 0.6, start: float = 0.0, growth: float = 0.0) -> list[list[float]]:
    """Return a stroke along an oval by an angle `turn`; on its way it grows by a fraction of its size."""
    angle = start + np.linspace(0.0, turn, 120)
    size = 0.2 * np.linspace(1.0, 1.0 + growth, 120)
    points: list[list[float]] = np.column_stack(
        [0.5 + size * np.cos(angle), 0.5 + ratio * size * np.sin(angle)]
    ).tolist()
    return points


def _line(*corners: tuple[float, float]) -> list[list[float]]:
    return [list(corner) for corner in corners]


@pytest.mark.parametrize(
    ("points", "kind"),
    [
        (_around(np.radians(360)), "ellipse"),
        (_around(np.radians(-360), start=2.0), "ellipse"),
        (_around(np.radians(310)), "ellipse"),
        (_around(np.radians(310), ratio=0.2, start=1.4), "ellipse"),
        (_around(np.radians(430), growth=0.1), "ellipse"),
        (_around(np.radians(700), growth=0.1), "ellipse"),
        (_line((0.2, 0.2), (0.6, 0.2), (0.6, 0.5), (0.2, 0.5), (0.2, 0.22)), "ellipse"),
        (_around(np.radians(250)), "arrow"),
        (_around(np.radians(360), ratio=0.05), "arrow"),
        (_line((0.2, 0.2), (0.6, 0.4)), "arrow"),
        (_line((0.2, 0.2), (0.6, 0.2), (0.6, 0.6)), "arrow"),
        (_line((0.2, 0.2), (0.6, 0.21), (0.2, 0.22)), "arrow"),
        (_line((0.3, 0.2), (0.3, 0.6), (0.45, 0.7), (0.6, 0.6), (0.6, 0.2)), "arrow"),
        # A loop on the way of an arrow.
        (
            [
                [0.02, 0.46],
                *[[0.5 + 0.05 * (x - 0.5) / 0.2, 0.5 + 0.05 * (y - 0.5) / 0.2] for x, y in _around(6.3)],
                [0.98, 0.46],
            ],
            "arrow",
        ),
        ([[0.5, 0.5], [0.5, 0.5]], "arrow"),
    ],
)
def test_a_stroke_is_an_oval_if_it_goes_round(points: list[list[float]], kind: str) -> None:
    assert classify_stroke(points) == kind


def test_what_a_stroke_is_does_not_depend_on_place_size_turn_or_sense() -> None:
    rng = np.random.default_rng(0)
    for points in (
        _around(5.6),
        _around(7.5, growth=0.05),
        _around(4.6),
        _line((0.3, 0.3), (0.6, 0.5), (0.5, 0.7)),
    ):
        line, kind = np.array(points), classify_stroke(points)
        for _ in range(10):
            angle = rng.uniform(0, 2 * np.pi)
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            moved = (line - 0.5) @ turn.T * rng.uniform(0.1, 1.0) + rng.uniform(0.4, 0.6, 2)
            assert classify_stroke(moved) == kind
            assert classify_stroke(moved[::-1]) == kind


@pytest.mark.parametrize(
    ("turn", "growth"), [(310.0, 0.0), (400.0, 0.0), (430.0, 0.04), (330.0, -0.04), (720.0, 0.0)]
)
def test_an_oval_that_stops_short_or_overshoots_is_the_same_oval(turn: float, growth: float) -> None:
    """By the area between the pen's ends, an oval whose stroke overshot its start was an arrow."""
    for start in np.linspace(0, 6, 7):
        read = parse_strokes([{"points": _around(np.radians(turn), start=start, growth=growth)}])
        assert isinstance(read, Ellipse)
        np.testing.assert_allclose(read.center, [0.5, 0.5], atol=0.0005 + 0.1 * abs(growth))
        np.testing.assert_allclose(read.axes, [0.2, 0.12], rtol=0.002 + abs(growth))


def test_tremor_of_an_arrow_is_smoothed_and_its_ends_are_kept() -> None:
    rng = np.random.default_rng(2)
    points = np.linspace([0.2, 0.3], [0.8, 0.6], 200) + rng.uniform(-0.001, 0.001, (200, 2))
    read = parse_strokes(
        [{"points": points.tolist(), "widths": np.linspace(4, 12, 200) + rng.uniform(-1, 1, 200)}]
    )
    assert isinstance(read, Arrow)
    assert read.points.tolist() == points[[0, -1]].tolist()
    assert read.widths is not None
    np.testing.assert_allclose(read.widths, [4, 12], atol=0.4)


@pytest.mark.parametrize(
    ("strokes", "message"),
    [
        ([], "exactly 1, got 0"),
        ("strokes", "list of one stroke"),
        ([{"points": [[0.3, 0.5]] * 4097}], r"strokes\[0\]\.points.*at most 4096"),
        ([{"points": [[0.3, float("nan")], [0.5, 0.5]]}], r"strokes\[0\]\.points\[0\]\[1\]"),
        ([{"points": [[0.3, True], [0.5, 0.5]]}], r"points\[0\]\[1\].*must be a number, got true"),
        ([ARROW | {"widths": [4]}], "one per point"),
        ([ARROW | {"times": [1.0, 0.5]}], "not decrease"),
        ([ARROW | {"kind": "square"}], "'arrow' or 'ellipse'"),
        ([ARROW | {"color": "red"}], "color"),
        ([{"points": [[0.2, 0.2], [0.4, 0.4], [0.6, 0.6]], "kind": "ellipse"}], "enclose an area"),
        ([{"points": [[0.2, 0.2], [0.201, 0.2]], "kind": "ellipse"}], "at least 0.025 m long"),
        ([{"points": _oval(turn=2.5), "kind": "ellipse"}], "more than half round"),
        (
            [
                {
                    "points": [[0.5 + 0.2 * np.sin(t), 0.5 + 0.2 * np.sin(2 * t)] for t in range(20)],
                    "kind": "ellipse",
                }
            ],
            "no oval.*at most 25%",
        ),
        ([None], r"strokes\[0\]"),
    ],
)
def test_bad_strokes_are_refused_with_field_and_range(strokes: Any, message: str) -> None:
    with pytest.raises(SketchError, match=message):
        parse_strokes(strokes)


@pytest.mark.parametrize(
    ("points", "widths", "message"),
    [
        ([[0.1, 0.2]], None, "2 to 4096"),
        (np.full((MAX_POINTS + 1, 2), 0.5), None, "2 to 4096"),
        ([[0.1, 0.2], [np.nan, 0.2]], None, r"points\[1\].*\[0, 4096\]"),
        ([[0.1, 0.2], [0.1, 4097.0]], None, r"points\[1\].*\[0, 4096\]"),
        ([[0.5, 0.5], [0.5, 0.5]], None, "all are in one place"),
        ([[0.1, 0.2, 0.3], [0.3, 0.2, 0.3]], None, r"\(K, 2\)"),
        ("words", None, "numbers"),
        ([[0.1, 0.2], [0.3, 0.2]], [4.0], r"one number per point \(2\)"),
        ([[0.1, 0.2], [0.3, 0.2]], [1.0, 4.0], r"\[2, 20\]"),
    ],
)
def test_a_bad_arrow_is_refused_with_field_and_range(points: object, widths: object, message: str) -> None:
    with pytest.raises(SketchError, match=message):
        Arrow(points, widths)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("center", "axes", "angle", "width", "message"),
    [
        ([0.5, 4097.0], [0.2, 0.1], 0.0, None, r"center.*\[0, 4096\]"),
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

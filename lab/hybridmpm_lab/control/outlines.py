"""Outlines of the families `shape` and `sequence`: rings, letters, hands and others, drawn by formulas."""

import numpy as np
import numpy.typing as npt

from hybridmpm.control import Shape

_Floats = npt.NDArray[np.float64]
_Lines = list[_Floats]

_ROUND = 96  # Points of a circle
_PALM = 24  # Points of an arc of a hand


def _arc(first: float, last: float, count: int, radius: float = 1.0) -> _Floats:
    """Return points (count, 2) of a circle between two angles [degrees]."""
    turn = np.deg2rad(np.linspace(first, last, count))
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])


def _circle(width: float = 1.0, height: float = 1.0) -> _Floats:
    return _arc(0, 360, _ROUND + 1)[:-1] * [width, height]


def _lines(*lines: list[tuple[float, float]]) -> _Lines:
    return [np.array(line) for line in lines]


def _star() -> _Lines:
    around = _arc(90, 450, 11)[:-1]
    return [around * np.where(np.arange(10) % 2 == 0, 1.0, 0.5)[:, None]]


def _heart() -> _Lines:
    t = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)
    height = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    return [np.column_stack([16 * np.sin(t) ** 3, height])]


def _crescent() -> _Lines:
    inner = _arc(300, 60, _ROUND // 2, 0.7) + np.array([0.5, 0.0])
    return [np.concatenate([_arc(50, 310, _ROUND), inner])]


def _hand(directions: tuple[float, ...], lengths: tuple[float, ...], half: float) -> _Lines:
    """Return a palm of radius 1 with fingers of a half width, at directions from the right [degrees]."""
    base = float(np.rad2deg(np.arcsin(half)))
    points, ended = [], -90.0
    for direction, length in zip(directions, lengths, strict=True):
        points += [_arc(ended, direction - base, _PALM)]
        tip = length * _arc(direction, direction, 1)
        points += [tip + _arc(direction - 90, direction + 90, _PALM, half)]
        ended = direction + base
    points += [_arc(ended, 270, _PALM)[:-1]]
    return [np.concatenate(points)]


_FRAME = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
OUTLINES: dict[str, _Lines] = {
    "ring": [_circle(), 0.6 * _circle()],
    "thick ring": [_circle(), 0.4 * _circle()],
    "flat ring": [_circle(1.3, 0.9), _circle(0.75, 0.4)],
    "frame": [np.array(_FRAME), 0.55 * np.array(_FRAME)],
    "L": _lines([(0, 0), (0.62, 0), (0.62, 0.24), (0.26, 0.24), (0.26, 1), (0, 1)]),
    "H": _lines(
        [
            (0, 0),
            (0.25, 0),
            (0.25, 0.38),
            (0.6, 0.38),
            (0.6, 0),
            (0.85, 0),
            (0.85, 1),
            (0.6, 1),
            (0.6, 0.62),
            (0.25, 0.62),
            (0.25, 1),
            (0, 1),
        ]
    ),
    "U": _lines([(0, 0), (0.85, 0), (0.85, 1), (0.6, 1), (0.6, 0.25), (0.25, 0.25), (0.25, 1), (0, 1)]),
    "E": _lines(
        [
            (0, 0),
            (0.7, 0),
            (0.7, 0.22),
            (0.26, 0.22),
            (0.26, 0.39),
            (0.62, 0.39),
            (0.62, 0.61),
            (0.26, 0.61),
            (0.26, 0.78),
            (0.7, 0.78),
            (0.7, 1),
            (0, 1),
        ]
    ),
    "T": _lines([(0.27, 0), (0.53, 0), (0.53, 0.75), (0.8, 0.75), (0.8, 1), (0, 1), (0, 0.75), (0.27, 0.75)]),
    "Z": _lines(
        [
            (0, 0),
            (0.8, 0),
            (0.8, 0.24),
            (0.34, 0.24),
            (0.8, 0.78),
            (0.8, 1),
            (0, 1),
            (0, 0.76),
            (0.46, 0.76),
            (0, 0.22),
        ]
    ),
    "C": [np.concatenate([_arc(45, 315, _ROUND), _arc(315, 45, _ROUND, 0.55)])],
    "O": [_circle(0.8, 1.0), _circle(0.45, 0.62)],
    "A": _lines(
        [(0, 0), (0.26, 0), (0.34, 0.24), (0.66, 0.24), (0.74, 0), (1, 0), (0.64, 1), (0.36, 1)],
        [(0.41, 0.45), (0.59, 0.45), (0.5, 0.74)],
    ),
    "hand": _hand((-3, 41, 73, 107, 142), (1.7, 2.3, 2.6, 2.5, 2.0), 0.24),
    "open hand": _hand((-20, 30, 70, 110, 150), (1.7, 2.1, 2.4, 2.3, 1.9), 0.27),
    "mitten": _hand((10, 100), (1.8, 2.2), 0.55),
    "star": _star(),
    "cross": _lines(
        [
            (0.35, 0),
            (0.65, 0),
            (0.65, 0.35),
            (1, 0.35),
            (1, 0.65),
            (0.65, 0.65),
            (0.65, 1),
            (0.35, 1),
            (0.35, 0.65),
            (0, 0.65),
            (0, 0.35),
            (0.35, 0.35),
        ]
    ),
    "heart": _heart(),
    "crescent": _crescent(),
}
"""Closed lines by name, of any size and place; a line within another one is a hole."""
_HIGH = 100.0
"""Shift that makes all coordinates positive, as sketches take them."""


def outline(name: str, area: float, center: _Floats, turn: float, width: float | None) -> Shape:
    """Return an outline of some area [m^2] around a point (2,) [m], turned by an angle [rad]."""
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    turned = [line @ rotation for line in OUTLINES[name]]
    size = float(np.sqrt(area / Shape(tuple(line + _HIGH for line in turned)).area))
    low, high = (size * np.array([end(line, axis=0) for line in turned]) for end in (np.min, np.max))
    middle = (low.min(axis=0) + high.max(axis=0)) / 2
    return Shape(tuple(center - middle + size * line for line in turned), width)

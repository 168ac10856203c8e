"""`shape_of_path`: the shape that the path of an SVG file encloses."""

import re
from collections.abc import Iterator, Sequence

import numpy as np

from hybridmpm._support.arguments import real
from hybridmpm.control.sketch.sketch import Floats, Shape
from hybridmpm.control.sketch.tracing import placed
from hybridmpm.errors import SketchError
from hybridmpm.scene.fields import LONGEST

_TOKEN = re.compile(r"([MmLlHhVvCcSsQqTtZzAa])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|([\s,]+)|(.)")
_COUNTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "Z": 0}
"""Numbers of a command."""
_PIECES = 16
"""Straight pieces of a curve."""
_LEAST = 1e-6
"""Smallest height of a shape [m]."""


def shape_of_path(path: str, center: Sequence[float], height: float, width: float | None = None) -> Shape:
    """Return the shape of an SVG path, the attribute `d` of its element, by the even-odd rule.

    Curves of Bezier become lines of 16 pieces. Parts that are not closed are closed by a straight line.

    Parameters
    ----------
    path : str
        Commands M, L, H, V, C, S, Q, T and Z, absolute or relative; arcs (A) are refused.
    center : float (2,)
        Middle of the rectangle around the shape [m].
    height : float in [1e-6, 4096]
        Height of that rectangle [m].
    width : float in [2, 20], optional
        As of `Shape`.

    Raises
    ------
    SketchError
        The path is none, has arcs, or encloses nothing.
    """
    lines = [np.array(line) * [1.0, -1.0] for line in _lines(path)]  # y points down in SVG
    lines = [line for line in lines if len(line) > 2]
    if not lines or not np.ptp(np.concatenate(lines)[:, 1]) > 0:
        raise SketchError("path: it encloses nothing")
    return Shape(placed(lines, center, real("height", height, _LEAST, LONGEST)), width)


def _commands(path: str) -> Iterator[tuple[str, list[float]]]:
    """Yield each command of a path with its numbers."""
    command, numbers = "", []
    tokens = [match.groups() for match in _TOKEN.finditer(path)]
    for letter, number, _, other in [*tokens, ("Z", None, None, None)]:
        if other is not None:
            raise SketchError(f"path: {other!r} is no part of a path")
        if number is not None:
            if not command or not _COUNTS[command.upper()]:
                raise SketchError(f"path: the number {number} follows no command that takes one")
            numbers.append(float(number))
            if len(numbers) == _COUNTS[command.upper()]:
                yield command, numbers
                # What follows the point of a move are points of lines.
                command, numbers = {"M": "L", "m": "l"}.get(command, command), []
        if letter is not None:
            if numbers:
                raise SketchError(f"path: {command} needs {_COUNTS[command.upper()]} numbers at a time")
            if letter in "Aa":
                raise SketchError("path: arcs (A) are not read: convert them to curves")
            command = letter
            if letter in "Zz":
                yield letter, []


def _lines(path: str) -> list[list[Floats]]:
    """Return the points of the lines of a path, in its own units."""
    lines: list[list[Floats]] = []
    at, start, control = np.zeros(2), np.zeros(2), np.zeros(2)
    before = ""
    for command, numbers in _commands(path):
        kind, origin = command.upper(), at if command.islower() else np.zeros(2)
        if kind == "Z":
            at, before = start, kind
            continue
        if kind in "HV":
            axis = "HV".index(kind)
            ends = [at.copy()]
            ends[0][axis] = numbers[0] + origin[axis]
        else:
            ends = [origin + point for point in np.reshape(numbers, (-1, 2))]
        if kind == "M":
            start = ends[0]
            lines.append([start])
        else:
            if not lines:
                raise SketchError("path: it must begin with M")
            if before == "Z":
                lines.append([at])
            if kind in "ST":
                same = before in ("CS" if kind == "S" else "QT") and before != ""
                ends = [2 * at - control if same else at, *ends]
            knots = np.array([at, *ends])
            control = knots[-2]
            lines[-1].extend(_curve(knots) if kind in "CSQT" else knots[1:])
        at, before = ends[-1], kind
    return lines


def _curve(knots: Floats) -> Floats:
    """Return points on a curve of Bezier after its start, by de Casteljau's construction."""
    share = np.linspace(0, 1, _PIECES + 1)[1:, None, None]
    points = np.tile(knots, (_PIECES, 1, 1))
    while points.shape[1] > 1:
        points = points[:, :-1] + share * np.diff(points, axis=1)
    return np.asarray(points[:, 0])

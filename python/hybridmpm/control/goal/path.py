"""The way that an arrow asks the centre of mass to go: few points, from a stroke of many."""

import numpy as np

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.sketch.sketch import Arrow, depth_of_width
from hybridmpm.scene import Walls

_TOLERANCE = 0.008
"""Largest distance [m] of a drawn point from the way that is made of fewer; a hand trembles by less."""
_PIECES = 8
"""Pieces into which a bent way is cut at least, so that the spline through them stays near to it."""


def arrow_path(arrow: Arrow, dim: int, walls: Walls) -> Floats:
    """Return points (K, D) [m] of the way of an arrow, from 0 on, K >= 2.

    Points that lie on a line between others are left out; a straight arrow has two. In 3D the widths of the
    stroke give the depth; without them it does not change.
    """
    points = np.array(arrow.points)
    if dim == 3:
        depth = np.zeros(len(points))
        if arrow.widths is not None:
            back, front = walls.lower[2], walls.upper[2]
            depth = np.array([depth_of_width(float(width), back, front) for width in arrow.widths])
        points = np.column_stack([points, depth])
    few = _simplified(points - points[0])
    if len(few) == 2:
        return few
    lengths = np.linalg.norm(np.diff(few, axis=0), axis=1)
    longest = lengths.sum() / _PIECES
    path = [few[:1]]
    for start, end, length in zip(few[:-1], few[1:], lengths, strict=True):
        steps = np.linspace(0, 1, int(np.ceil(length / longest - 1e-9)) + 1)[1:, None]
        path.append(start + steps * (end - start))
    return np.concatenate(path)


def _simplified(points: Floats) -> Floats:
    """Leave out points near to lines between others (Ramer 1972; Douglas and Peucker 1973)."""
    kept = np.zeros(len(points), dtype=bool)
    kept[[0, -1]] = True
    open_ends = [(0, len(points) - 1)]
    while open_ends:
        first, last = open_ends.pop()
        if last - first < 2:
            continue
        inner = points[first + 1 : last]
        along = points[last] - points[first]
        square = float(along @ along)
        share = np.clip((inner - points[first]) @ along / max(square, 1e-18), 0, 1)
        away = np.linalg.norm(inner - points[first] - share[:, None] * along, axis=1)
        worst = int(np.argmax(away))
        if away[worst] > _TOLERANCE:
            middle = first + 1 + worst
            kept[middle] = True
            open_ends += [(first, middle), (middle, last)]
    return np.asarray(points[kept])

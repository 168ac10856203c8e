"""The way that an arrow asks the centre of mass to go: few points, from a stroke of many."""

import heapq

import numpy as np

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.sketch.sketch import Arrow, depth_of_width
from hybridmpm.scene import Walls

_TOLERANCE = 0.008
"""Largest distance [m] of a drawn point from the way that is made of fewer; a hand trembles by less."""
_CORNERS = 64
"""Most points of the simplified way. Timing a way takes time with the square of its points, and no fluid
follows so many bends."""
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
    """Leave out points near to lines between others (Ramer 1972; Douglas and Peucker 1973).

    Where more than `_CORNERS` points would be left, those are kept that lie farthest off.
    """
    kept = [0, len(points) - 1]
    gaps = [_farthest(points, *kept)]
    while len(kept) < _CORNERS and -gaps[0][0] > _TOLERANCE:
        _, middle, first, last = heapq.heappop(gaps)
        kept.append(middle)
        heapq.heappush(gaps, _farthest(points, first, middle))
        heapq.heappush(gaps, _farthest(points, middle, last))
    return np.asarray(points[sorted(kept)])


def _farthest(points: Floats, first: int, last: int) -> tuple[float, int, int, int]:
    """Return the negative distance [m] of the point farthest off a line between two, and the three points."""
    if last - first < 2:
        return 0.0, first, first, last
    inner = points[first + 1 : last]
    along = points[last] - points[first]
    square = float(along @ along)
    share = np.clip((inner - points[first]) @ along / max(square, 1e-18), 0, 1)
    away = np.linalg.norm(inner - points[first] - share[:, None] * along, axis=1)
    worst = int(np.argmax(away))
    return -float(away[worst]), first + 1 + worst, first, last

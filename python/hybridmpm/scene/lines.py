"""Lines through points of the plane: fewer points, and distances."""

import numpy as np

from hybridmpm.scene.fields import Points


def simplified(points: Points, tolerance: float) -> list[int]:
    """Return the indices of the fewest-found points (K, 2) that tell the line within a distance.

    A point is left out if it lies within `tolerance` of the line through the points that are kept. The first
    and the last are always kept.

    References
    ----------
    Douglas and Peucker, Algorithms for the reduction of the number of points required to represent a
    digitized line, Cartographica 10(2), 1973.
    """
    kept = {0, len(points) - 1}
    # A stack instead of recursion, because a spiral of thousands of points would nest as deep.
    pieces = [(0, len(points) - 1)]
    while pieces:
        first, last = pieces.pop()
        if last - first < 2:
            continue
        distance = distance_to_segment(points[first + 1 : last], points[first], points[last])
        worst = int(distance.argmax())
        if distance[worst] > tolerance:
            middle = first + 1 + worst
            kept.add(middle)
            pieces += [(first, middle), (middle, last)]
    return sorted(kept)


def distance_to_segment(
    points: Points, start: Points, end: Points, radii: tuple[float, float] = (0.0, 0.0)
) -> Points:
    """Return the distances (K,) of points (K, 2) to the segment from `start` to `end`.

    With the `radii` of its two ends, between which the radius changes linearly, they are less the radius at
    the nearest place: negative inside of the stroke.
    """
    along = end - start
    square = float(along @ along)
    fraction = np.clip((points - start) @ along / square, 0.0, 1.0) if square > 0 else np.zeros(len(points))
    away = np.hypot(*(points - start - fraction[:, None] * along).T)
    return np.asarray(away - radii[0] - fraction * (radii[1] - radii[0]))

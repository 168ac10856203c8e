"""Lines through points, in any unit of length: how long they are, even spacing, and fewer points."""

from itertools import pairwise

import numpy as np

from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.scene.lines import distance_to_segment

_STRAIGHTNESS = 0.003
"""Weight of the bends of a line of values beside its distance from the values [-]."""
_REWEIGHTED = 4
"""Number of fits, between which values far from the line lose weight."""
_ROUNDING = 0.1
"""Distance of values from their line below which they count in full [pixels]."""


def arc_lengths(points: Floats) -> Floats:
    """Return the length (K,) of the line from its first of the `points` (K, 2) to each of them."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def at_arc_length(points: Floats, places: Floats) -> Floats:
    """Return the points (M, 2) of a line (K, 2) at arc lengths `places` (M,)."""
    lengths = arc_lengths(points)
    return np.column_stack([np.interp(places, lengths, points[:, axis]) for axis in (0, 1)])


def evenly_spaced(points: Floats, count: int) -> Floats:
    """Return `count` points (count, 2) at equal distances along a line (K, 2), its ends among them."""
    return at_arc_length(points, np.linspace(0.0, float(arc_lengths(points)[-1]), count))


def distance_to_line(points: Floats, line: Floats, radii: Floats | None = None) -> Floats:
    """Return the distances (K,) of points (K, 2) to a line (M, 2), or to a stroke with `radii` (M,) there."""
    radii = np.zeros(len(line)) if radii is None else radii
    nearest = np.full(len(points), np.inf)
    for ends, at_ends in zip(pairwise(line), pairwise(radii.tolist()), strict=True):
        np.minimum(nearest, distance_to_segment(points, *ends, at_ends), out=nearest)
    return nearest


def values_at_knots(places: Floats, values: Floats, knots: Floats) -> Floats:
    """Return values (M,) at `knots` (M,) for which the lines between them run nearest to given values.

    The given values (K,) are those at `places` (K,).
    Values far from the lines hardly count, and where there are none the lines go on as straight as they can.
    """
    span = max(float(knots[-1] - knots[0]), 1e-9)
    hats = np.column_stack([np.interp(places, knots, row) for row in np.eye(len(knots))])
    slopes = np.diff(np.eye(len(knots)), axis=0) / np.maximum(np.diff(knots), 1e-9)[:, None] * span
    # Outside of the knots a hat goes on as the line through the last two.
    hats += np.outer(np.minimum(places - knots[0], 0.0) / span, slopes[0])
    hats += np.outer(np.maximum(places - knots[-1], 0.0) / span, slopes[-1])
    bends = np.diff(slopes, axis=0) * _STRAIGHTNESS * np.sqrt(len(places))
    weights = np.ones(len(places))
    target = np.concatenate([values, np.zeros(len(bends))])
    for _ in range(_REWEIGHTED):
        scale = np.concatenate([np.sqrt(weights), np.ones(len(bends))])
        solution = np.linalg.lstsq(np.vstack([hats, bends]) * scale[:, None], target * scale, rcond=None)[0]
        miss = values - hats @ solution
        weights = 1.0 / (1.0 + (miss / max(float(np.median(np.abs(miss))), _ROUNDING)) ** 2)
    return np.asarray(solution)

"""The ellipse that a drawn outline stands for, whether its points come from a pen or are pixels of ink.

Seen from its middle, an outline is a distance for each direction. Means over narrow sectors of directions
take out tremor and lines that were drawn twice; sectors without points are bridged. Lengths
are in any one unit.
"""

from dataclasses import dataclass

import numpy as np

from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.errors import SketchError

_SECTORS = 120
"""Number of sectors of directions, 3 degrees each."""
_ROUNDS = 30
"""Largest number of times that an ellipse is fitted; each divides the error by three or more."""
_SETTLED = 1e-5
"""Change of the semi-axes, as a fraction, below which the fit has settled."""
_FLAT = 1e-3
"""Smallest ratio of the semi-axes; a flatter outline is a line."""


@dataclass(frozen=True)
class Outline:
    """An ellipse fitted to an outline, and how well the outline is described by it."""

    center: Floats
    """Centre (2,)."""
    axes: Floats
    """Semi-axes (2,), major first."""
    angle: float
    """Angle of the major axis to the first coordinate axis, in [-pi/2, pi/2) [rad]."""
    gap: float
    """Widest angle without a point, as seen from the centre where the ellipse is made a circle [rad]."""
    spread: float
    """Root mean square distance of the points from the smoothed outline, over the size of the ellipse [-]."""

    @property
    def perimeter(self) -> float:
        """Length of the ellipse."""
        turn = np.linspace(0.0, 2 * np.pi, 361)
        ring = np.column_stack([np.cos(turn), np.sin(turn)]) * self.axes
        return float(np.hypot(*np.diff(ring, axis=0).T).sum())

    def local(self, points: Floats) -> Floats:
        """Return points (K, 2) in the frame in which the ellipse is the unit circle, major axis first."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return np.asarray((points - self.center) @ np.array([[cos, -sin], [sin, cos]]) / self.axes)


def fit_outline(points: Floats, weights: Floats) -> Outline:
    """Return the ellipse with the centre and the second moments of the area within an outline.

    Parameters
    ----------
    points : float (K, 2)
        Points of the outline in any order, dense enough that 3 degrees without a point are a gap.
    weights : float (K,)
        Length of line, or amount of ink, that each point stands for.

    Raises
    ------
    SketchError
        The points lie on a line.
    """
    share = weights / weights.sum()
    center = share @ points
    # On a circle, points of the line vary twice as much along each axis as points of the disc.
    covariance = (points - center).T @ ((points - center) * share[:, None]) / 2
    for _ in range(_ROUNDS):
        outline = _ellipse(center, covariance)
        local = outline.local(points)
        radius = np.hypot(*local.T)
        ring, gap, spread = _ring(np.arctan2(local[:, 1], local[:, 0]), radius, share)
        cos, sin = np.cos(outline.angle), np.sin(outline.angle)
        corners = outline.center + ring * outline.axes @ np.array([[cos, sin], [-sin, cos]])
        center, covariance = _area_moments(corners)
        fitted = _ellipse(center, covariance)
        change = float(np.abs(fitted.axes / outline.axes - 1).max())
        moved = float(np.abs(fitted.center - outline.center).max()) / float(fitted.axes[0])
        if max(change, moved) < _SETTLED:
            break
    return Outline(fitted.center, fitted.axes, fitted.angle, gap, spread)


def _ring(direction: Floats, radius: Floats, share: Floats) -> tuple[Floats, float, float]:
    """Return a closed line (S, 2), the widest angle without points, and the points' spread about the line."""
    sector = ((direction + np.pi) / (2 * np.pi) * _SECTORS).astype(np.int64) % _SECTORS
    # A sector holds more of the ink that lies farther out.
    weight = share / np.maximum(radius, 0.1)
    total = np.bincount(sector, weight, _SECTORS)
    filled = np.flatnonzero(total > 0)
    mean = np.bincount(sector, weight * radius, _SECTORS)[filled] / total[filled]
    everywhere = np.interp(np.arange(_SECTORS), filled, mean, period=_SECTORS)
    steps = np.diff(np.append(filled, filled[0] + _SECTORS))
    gap = float(steps.max() - 1) * 2 * np.pi / _SECTORS
    spread = float(np.sqrt(share @ (radius - everywhere[sector]) ** 2))
    middle = (np.arange(_SECTORS) + 0.5) * 2 * np.pi / _SECTORS - np.pi
    return np.column_stack([np.cos(middle), np.sin(middle)]) * everywhere[:, None], gap, spread


def _area_moments(corners: Floats) -> tuple[Floats, Floats]:
    """Return centre (2,) and covariance (2, 2) of the area within a polygon (K, 2), by Green's theorem."""
    # Taken about a point inside: the formulas cancel badly far from the origin.
    origin = corners.mean(axis=0)
    here = corners - origin
    after = np.roll(here, -1, axis=0)
    cross = here[:, 0] * after[:, 1] - after[:, 0] * here[:, 1]
    area = cross.sum() / 2
    first = cross @ (here + after) / (6 * area)
    both = here + after
    second = (
        np.einsum("k,ki,kj->ij", cross, here, here)
        + np.einsum("k,ki,kj->ij", cross, after, after)
        + np.einsum("k,ki,kj->ij", cross, both, both)
    ) / (24 * area)
    return origin + first, second - np.outer(first, first)


def _ellipse(center: Floats, covariance: Floats) -> Outline:
    """Return the ellipse whose area has this centre and covariance: its semi-axes are 2 sqrt(lambda)."""
    values, vectors = np.linalg.eigh(covariance)
    if not values[0] > _FLAT**2 * values[1]:
        raise SketchError("an oval must enclose an area, but this line lies nearly on a straight one")
    angle = (float(np.arctan2(vectors[1, 1], vectors[0, 1])) + np.pi / 2) % np.pi - np.pi / 2
    return Outline(center, 2 * np.sqrt(values[::-1]), angle, 0.0, 0.0)

"""`Oval`: an ellipse, or an ellipsoid in 3D, with a measure of how far out a point lies."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.sketch.sketch import Ellipse, depth_of_width
from hybridmpm.scene import Walls


@dataclass(frozen=True, eq=False)
class Oval:
    """An ellipse or ellipsoid."""

    center: Floats
    """Centre (D,) [m]."""
    axes: Floats
    """Semi-axes (D,) [m]."""
    directions: Floats
    """Unit vectors along the semi-axes, as rows (D, D)."""

    @classmethod
    def drawn(cls, sketch: Ellipse, cloud: Cloud, walls: Walls) -> Self:
        """Return what an ellipse stands for.

        In 3D the third semi-axis, along the depth, is the geometric mean of the two that are drawn. The width
        of the stroke gives the depth of the centre; without a width that of the centre of mass is kept.
        """
        cos, sin = np.cos(sketch.angle), np.sin(sketch.angle)
        directions = np.eye(cloud.dim)
        directions[:2, :2] = [[cos, sin], [-sin, cos]]
        if cloud.dim == 2:
            return cls(np.array(sketch.center), np.array(sketch.axes), directions)
        depth = float(cloud.centroid[2])
        if sketch.width is not None:
            depth = depth_of_width(sketch.width, walls.lower[2], walls.upper[2])
        axes = np.append(sketch.axes, np.sqrt(sketch.axes[0] * sketch.axes[1]))
        return cls(np.append(sketch.center, depth), axes, directions)

    @classmethod
    def ball(cls, center: Floats, volume: float) -> Self:
        """Return a disc, or a ball in 3D, of a volume [m^D] around a centre (D,) [m]."""
        dim = len(center)
        unit = np.pi if dim == 2 else 4 / 3 * np.pi
        return cls(np.asarray(center), np.full(dim, (volume / unit) ** (1 / dim)), np.eye(dim))

    @property
    def volume(self) -> float:
        """Volume, in 2D the area [m^D]."""
        return float(np.prod(self.axes) * (np.pi if len(self.axes) == 2 else 4 / 3 * np.pi))

    def sample(self) -> Floats:
        """Return points (K, D) all over the oval [m]."""
        side = np.linspace(-1, 1, 15)
        lattice = np.stack(np.meshgrid(*[side] * len(self.axes)), axis=-1).reshape(-1, len(self.axes))
        within = lattice[np.linalg.norm(lattice, axis=1) <= 1]
        return np.asarray(self.center + within * self.axes @ self.directions)

    def level(self, x: Floats) -> Floats:
        """Return for points (N, D) how many times as large the oval must be to reach each; (N,) [-]."""
        within = (x - self.center) @ (self.directions.T / self.axes)
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", within, within)))

    def stretch(self, side: float) -> float:
        """Return the largest difference of the level within a cube of a side [m] from that of its centre."""
        corners = np.stack(np.meshgrid(*[[-side / 2, side / 2]] * len(self.axes)), axis=-1)
        offsets = corners.reshape(-1, len(self.axes)) @ (self.directions.T / self.axes)
        return float(np.linalg.norm(offsets, axis=1).max())

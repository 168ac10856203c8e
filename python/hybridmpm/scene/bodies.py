"""Bodies: shapes of material that become particles."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field

from hybridmpm.scene.facets import MeshShape, PolygonShape, corners_around, mesh_of, points_of
from hybridmpm.scene.fields import Points, Seed, Velocity
from hybridmpm.scene.materials import Material
from hybridmpm.scene.shapes import BallShape, BoxShape, CylinderShape, Shaped


class _Body(Shaped):
    material: Material
    velocity: Velocity | None = Field(None, description="Initial velocity, D numbers [m/s]; zero if absent.")
    seed: Seed = Field(0, description="Seed of the jitter of particle positions.")


class Box(BoxShape, _Body):
    """Axis-aligned box of material."""

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the box [m]."""
        return np.array(self.lower), np.array(self.upper)

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, D) lie strictly inside; shape (N,)."""
        lower, upper = self.bounds
        x = points_of(x, len(lower))
        return np.asarray(((x > lower) & (x < upper)).all(axis=1))


class Ball(BallShape, _Body):
    """Disc in 2D, ball in 3D."""

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the bounding box [m]."""
        center = np.array(self.center)
        return center - self.radius, center + self.radius

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, D) lie strictly inside; shape (N,)."""
        inside: npt.NDArray[np.bool_] = ((points_of(x, len(self.center)) - np.array(self.center)) ** 2).sum(
            axis=1
        ) < self.radius**2
        return inside


class Cylinder(CylinderShape, _Body):
    """Cylinder with flat ends, 3D only."""

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the bounding box [m]."""
        start, end = np.array(self.start), np.array(self.end)
        reach = self.radius * np.sqrt(np.maximum(1.0 - self.direction**2, 0.0))
        return np.minimum(start, end) - reach, np.maximum(start, end) + reach

    @property
    def measure(self) -> float:
        """Volume [m^3]."""
        return math.pi * self.radius**2 * self.length

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, 3) lie strictly inside; shape (N,)."""
        along = self.direction
        from_start = points_of(x, 3) - np.array(self.start)
        height = from_start @ along
        beside = ((from_start - height[:, None] * along) ** 2).sum(axis=1)
        return np.asarray((height > 0) & (height < self.length) & (beside < self.radius**2))


class Polygon(PolygonShape, _Body):
    """Closed polygon, 2D only. It may be concave; what lies inside follows the even-odd rule."""

    @classmethod
    def around(
        cls,
        outlines: Sequence[npt.ArrayLike],
        *,
        material: Material | str,
        velocity: Sequence[float] | None = None,
        seed: int = 0,
    ) -> Self:
        """Return the polygon of what several closed lines enclose; a line within another one makes a hole.

        Parts may lie apart, as letters do. The one outline of the polygon runs along all lines in turn and
        returns by the same way. `hybridmpm.control` reads lines from texts, pictures and SVG paths:
        `Polygon.around(shape_of_text("wave", (0.5, 0.6), 0.2).outlines, material="water")`.

        Parameters
        ----------
        outlines : sequence of float (K, 2), K >= 3
            Closed lines [m]; the last point of each joins the first. By the even-odd rule a point is inside
            where a ray from it crosses them an odd number of times. They may have 1000 points, with two more
            for each line but the first.
        material, velocity, seed
            As of any body.

        Raises
        ------
        ConfigError
            There is no line, or one is not of this form.
        SceneError
            A value is out of range.
        """
        fields = {"vertices": corners_around(outlines), "material": material}
        return cls(**fields, velocity=velocity, seed=seed)


class Mesh(MeshShape, _Body):
    """What a closed surface of triangles encloses, 3D only. The surface must not cross itself."""

    @classmethod
    def read(
        cls,
        path: str | Path,
        center: Sequence[float],
        height: float,
        *,
        material: Material | str,
        velocity: Sequence[float] | None = None,
        seed: int = 0,
    ) -> Self:
        """Return the body within the surface of a file, .stl, .obj, .ply or .glb, as of modelling programs.

        The body has the surface itself, so scenes and snapshots need the file no more. Vertices at the same
        place count as one. Axes stay as they are in the file; y is up.

        Parameters
        ----------
        path : path
            File with at most 200 000 triangles.
        center : float (3,)
            Middle of the box around the surface [m].
        height : float in [1e-6, 4096]
            Length of that box along y [m].
        material, velocity, seed
            As of any body.

        Raises
        ------
        ConfigError
            trimesh is not installed (pip install 'hybridmpm[shapes]'), or the ending is another one.
        DataError
            The file cannot be read, or has no triangles.
        SceneError
            The surface is not closed, the message names open edges, or a value is out of range.
        """
        fields = mesh_of(path, center, height) | {"material": material}
        return cls(**fields, velocity=velocity, seed=seed)


Body = Annotated[Box | Ball | Cylinder | Polygon | Mesh, Field(discriminator="shape")]

"""Bodies: shapes of material that become particles."""

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from hybridmpm._support.arguments import float64, real
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene import meshes
from hybridmpm.scene.fields import LONGEST, Point, Points, Seed, Velocity, raise_faults
from hybridmpm.scene.materials import Material
from hybridmpm.scene.shapes import BallShape, BoxShape, CylinderShape, Shaped

_MOST_CORNERS = 1000
_MOST_TRIANGLES = 200_000
_LEVELS = 16
"""Number of heights between two corners of a polygon at which its width is taken."""


def _points(x: npt.ArrayLike, dim: int) -> Points:
    """Return points (N, D) as float64, or raise `ConfigError`."""
    points = float64("x", x)
    if points.ndim != 2 or points.shape[1] != dim:
        raise ConfigError(f"x must have shape (N, {dim}), got {points.shape}")
    return points


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
        x = _points(x, len(lower))
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
        inside: npt.NDArray[np.bool_] = ((_points(x, len(self.center)) - np.array(self.center)) ** 2).sum(
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
        from_start = _points(x, 3) - np.array(self.start)
        height = from_start @ along
        beside = ((from_start - height[:, None] * along) ** 2).sum(axis=1)
        return np.asarray((height > 0) & (height < self.length) & (beside < self.radius**2))


class Polygon(_Body):
    """Closed polygon, 2D only. It may be concave; what lies inside follows the even-odd rule."""

    shape: Literal["polygon"] = "polygon"
    vertices: Annotated[tuple[Point, ...], Field(min_length=3, max_length=_MOST_CORNERS)] = Field(
        description="Corners of the polygon in order [m]; an edge joins the last to the first."
    )

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
        lines = [float64(f"outlines[{number}]", line) for number, line in enumerate(outlines)]
        if not lines:
            raise ConfigError("outlines: there must be at least one line")
        for number, line in enumerate(lines):
            if line.ndim != 2 or line.shape[1] != 2 or len(line) < 3:
                shape = line.shape
                raise ConfigError(f"outlines[{number}] must have shape (K, 2) with K >= 3, got {shape}")
        # Ways from the first line to the others are edges there and back, which count as none.
        corners = np.vstack([lines[0], *(np.vstack([lines[0][:1], line, line[:1]]) for line in lines[1:])])
        if len(corners) > _MOST_CORNERS:
            text = (
                f"they have {len(corners)} points with the ways between, at most {_MOST_CORNERS} are allowed"
            )
            raise ConfigError(f"outlines: {text}; make them simpler")
        fields = {"vertices": corners.tolist(), "material": material, "velocity": velocity, "seed": seed}
        return cls.model_validate(fields)

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the bounding box [m]."""
        corners = np.array(self.vertices)
        return corners.min(axis=0), corners.max(axis=0)

    def _edges(self) -> tuple[Points, Points]:
        """Return the ends (K, 2) of the edges in order [m], without those that lead there and back."""
        edges = list(zip(self.vertices, (*self.vertices[1:], self.vertices[0]), strict=True))
        times = Counter(frozenset(edge) for edge in edges)
        kept = np.array([edge for edge in edges if times[frozenset(edge)] % 2]).reshape(-1, 2, 2)
        return kept[:, 0], kept[:, 1]

    @property
    def measure(self) -> float:
        """Area [m^2] by the even-odd rule; exact unless the outline crosses itself, then to 0.1 %."""
        a, b = self._edges()
        lowest, highest = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
        area = 0.0
        for low, high in pairwise(np.unique(a[:, 1])):
            # Between two corners' heights the width is linear but for crossings, so its mean is exact.
            levels = low + (high - low) * (np.arange(_LEVELS) + 0.5) / _LEVELS
            spans = (lowest <= low) & (highest >= high)
            (ax, ay), (bx, by) = a[spans].T[..., None], b[spans].T[..., None]
            across = np.sort(ax + (levels - ay) * (bx - ax) / (by - ay), axis=0)
            area += (high - low) * float((across[1::2] - across[::2]).sum()) / _LEVELS
        return area

    @property
    def smallest_extent(self) -> float:
        """Shorter side [m] of the rectangle with this area and length of the outline: a thin one may bend."""
        start, end = self._edges()
        outline = float(np.linalg.norm(start - end, axis=1).sum())
        return (outline - math.sqrt(max(0.0, outline**2 - 16 * self.measure))) / 4

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, 2) lie inside; shape (N,)."""
        x = _points(x, 2)
        order = np.argsort(x[:, 1])
        across, height = x[order].T
        odd = np.zeros(len(x), dtype=bool)
        for (ax, ay), (bx, by) in zip(*self._edges(), strict=True):
            # Only points first to last have the edge at their height. A horizontal edge is at no height,
            # since no horizontal ray crosses it.
            first, last = np.searchsorted(height, sorted((ay, by)))
            if first < last:
                beside = slice(first, last)
                odd[beside] ^= across[beside] < ax + (height[beside] - ay) * (bx - ax) / (by - ay)
        inside = np.empty_like(odd)
        inside[order] = odd
        return inside


class Mesh(_Body):
    """What a closed surface of triangles encloses, 3D only. The surface must not cross itself."""

    shape: Literal["mesh"] = "mesh"
    vertices: Annotated[tuple[Point, ...], Field(min_length=4, max_length=_MOST_TRIANGLES)] = Field(
        description="Corners of the triangles, 3 coordinates each [m]."
    )
    triangles: Annotated[
        tuple[Annotated[tuple[int, ...], Field(min_length=3, max_length=3)], ...],
        Field(min_length=4, max_length=_MOST_TRIANGLES),
    ] = Field(description="Indices of three vertices each, all of them the same way round.")

    @model_validator(mode="after")
    def _encloses(self) -> Self:
        flat = [index for index, vertex in enumerate(self.vertices) if len(vertex) != 3]
        if flat:
            raise_faults("Mesh", [(("vertices", flat[0]), "must have 3 numbers; a mesh is for dim 3 only")])
        highest = len(self.vertices) - 1
        for number, corners in enumerate(self.triangles):
            if min(corners) < 0 or max(corners) > highest:
                text = f"must be indices in [0, {highest}], got {list(corners)}"
                raise_faults("Mesh", [(("triangles", number), text)])
        raise_faults("Mesh", meshes.faults(*self._arrays()))
        return self

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
        vertices, triangles = meshes.read(Path(path))
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        if not high[1] > low[1]:
            raise DataError(f"{path}: the surface has no height, along y")
        scale = real("height", height, 1e-6, LONGEST) / (high[1] - low[1])
        placed = (vertices - (low + high) / 2) * scale + float64("center", center)
        fields = {"vertices": placed.tolist(), "triangles": triangles.tolist(), "material": material}
        return cls.model_validate(fields | {"velocity": velocity, "seed": seed})

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Return the velocity; vertices have three numbers in any case."""
        return {} if self.velocity is None else {"velocity": self.velocity}

    def _arrays(self) -> tuple[Points, meshes.Triangles]:
        return np.array(self.vertices), np.array(self.triangles)

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the bounding box [m]."""
        corners = np.array(self.vertices)
        return corners.min(axis=0), corners.max(axis=0)

    @property
    def measure(self) -> float:
        """Volume [m^3]."""
        return abs(meshes.volume(*self._arrays()))

    @property
    def smallest_extent(self) -> float:
        """Height [m] of the square plate with this volume and area of the surface: a thin one may bend."""
        return meshes.thickness(*self._arrays())

    @property
    def tests_of_a_point(self) -> float:
        """Mean number of triangles that `contains` tests a point against."""
        return meshes.tests_of_a_point(*self._arrays())

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, 3) lie inside; shape (N,)."""
        return meshes.contains(*self._arrays(), _points(x, 3))


Body = Annotated[Box | Ball | Cylinder | Polygon | Mesh, Field(discriminator="shape")]

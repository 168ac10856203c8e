"""Shapes of many facets: polygons in 2D, closed surfaces of triangles in 3D."""

import math
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from hybridmpm._support.arguments import float64, real
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene import meshes, surface_files
from hybridmpm.scene.fields import LONGEST, Coordinate, Point, Points, raise_faults, unequal_faults
from hybridmpm.scene.rows import Rows, Table
from hybridmpm.scene.shapes import Shaped

MOST_CORNERS = 1000
_LEVELS = 16
"""Number of heights between two corners of a polygon at which its width is taken."""


def points_of(x: npt.ArrayLike, dim: int) -> Points:
    """Return points (N, D) as float64, or raise `ConfigError`."""
    points = float64("x", x)
    if points.ndim != 2 or points.shape[1] != dim:
        raise ConfigError(f"x must have shape (N, {dim}), got {points.shape}")
    return points


class PolygonShape(Shaped):
    """Closed polygon, 2D only. It may be concave; what lies inside follows the even-odd rule."""

    shape: Literal["polygon"] = "polygon"
    vertices: Annotated[tuple[Point, ...], Field(min_length=3, max_length=MOST_CORNERS)] = Field(
        description="Corners of the polygon in order [m]; an edge joins the last to the first."
    )

    @model_validator(mode="after")
    def _encloses(self) -> Self:
        raise_faults("Polygon", unequal_faults("vertices", self.vertices))
        # Polygons for 3D are refused where the dimension is known.
        if len(self.vertices[0]) == 2 and not self.measure > 1e-12 * np.prod(np.ptp(self.vertices, axis=0)):
            raise_faults("Polygon", [(("vertices",), "must enclose an area")])
        return self

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
        x = points_of(x, 2)
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


Vertices = Annotated[Rows, Table(Coordinate, "<f8", most=meshes.MAX_TRIANGLES, high=LONGEST)]
"""Corners (V, 3) of a surface [m]."""
Triangles = Annotated[Rows, Table(int, "<u4", most=meshes.MAX_TRIANGLES, high=meshes.MAX_TRIANGLES)]
"""Indices (T, 3) of its corners."""


class MeshShape(Shaped):
    """What a closed surface of triangles encloses, 3D only. The surface must not cross itself."""

    shape: Literal["mesh"] = "mesh"
    vertices: Vertices = Field(description="Corners of the triangles, 3 coordinates each [m].")
    triangles: Triangles = Field(
        description="Indices of three vertices each, all of them the same way round."
    )

    @model_validator(mode="after")
    def _encloses(self) -> Self:
        highest = len(self.vertices) - 1
        indices = np.asarray(self.triangles)
        wrong = np.flatnonzero(((indices < 0) | (indices > highest)).any(axis=1))
        if len(wrong):
            number = int(wrong[0])
            text = f"must be indices in [0, {highest}], got {list(self.triangles[number])}"
            raise_faults("Mesh", [(("triangles", number), text)])
        raise_faults("Mesh", meshes.faults(*self._arrays()))
        return self

    def _arrays(self) -> tuple[Points, meshes.Triangles]:
        return np.asarray(self.vertices), np.asarray(self.triangles)

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the bounding box [m]."""
        corners = np.asarray(self.vertices)
        return corners.min(axis=0), corners.max(axis=0)

    def coarser(self, most: int) -> tuple[Points, meshes.Triangles]:
        """Return vertices (V, 3) and at most so many triangles (T, 3) of a surface that looks alike."""
        return meshes.coarser(*self._arrays(), most)

    @property
    def crossing(self) -> list[float] | None:
        """A point (3,) where triangles without a common corner cross [m]; None where none do."""
        return meshes.crossing(*self._arrays())

    @property
    def measure(self) -> float:
        """Volume [m^3]; exact unless the surface crosses itself, then to 0.1 % of what lies inside."""
        return _inside(self.vertices, self.triangles)

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
        return meshes.contains(*self._arrays(), points_of(x, 3))


@lru_cache(maxsize=16)
def _inside(vertices: tuple[Point, ...], triangles: tuple[tuple[int, ...], ...]) -> float:
    return meshes.inside(np.array(vertices), np.array(triangles))


def corners_around(outlines: Sequence[npt.ArrayLike]) -> list[list[float]]:
    """Return the corners of one polygon that encloses what several closed lines (K, 2) do."""
    lines = [float64(f"outlines[{number}]", line) for number, line in enumerate(outlines)]
    if not lines:
        raise ConfigError("outlines: there must be at least one line")
    for number, line in enumerate(lines):
        if line.ndim != 2 or line.shape[1] != 2 or len(line) < 3:
            shape = line.shape
            raise ConfigError(f"outlines[{number}] must have shape (K, 2) with K >= 3, got {shape}")
    # Ways from the first line to the others are edges there and back, which count as none.
    corners = np.vstack([lines[0], *(np.vstack([lines[0][:1], line, line[:1]]) for line in lines[1:])])
    if len(corners) > MOST_CORNERS:
        text = f"they have {len(corners)} points with the ways between, at most {MOST_CORNERS} are allowed"
        raise ConfigError(f"outlines: {text}; make them simpler")
    return list(corners.tolist())


def mesh_of(path: str | Path, center: Sequence[float], height: float) -> dict[str, Any]:
    """Return vertices and triangles of a file, put at `center` with this height [m]; see `Mesh.read`."""
    middle = middle_of(center, 3)
    vertices, triangles = surface_files.read(Path(path))
    if not len(vertices) or not np.ptp(vertices[:, 1]) > 0:
        raise DataError(f"{path}: the surface has no height, along y")
    (found,) = fitted([vertices], middle, real("height", height, 1e-6, LONGEST))
    within_worlds(found)
    return {"vertices": Rows(found), "triangles": Rows(triangles)}


def middle_of(center: npt.ArrayLike, dim: int) -> Points:
    """Return a place (D,), or raise `ConfigError`."""
    middle = float64("center", center)
    if middle.shape != (dim,) or not np.isfinite(middle).all():
        raise ConfigError(f"center must be {dim} finite numbers [m], got {center!r}")
    return middle


def fitted(parts: Sequence[Points], center: npt.ArrayLike, height: float) -> list[Points]:
    """Return points (K, D) of parts, with the middle of the box around all at `center` and its height [m]."""
    points = np.concatenate(parts)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = height / (high[1] - low[1])
    return [(part - (low + high) / 2) * scale + center for part in parts]


def within_worlds(points: Points) -> None:
    """Raise `ConfigError` where points (N, D) lie in no world."""
    low, high = points.min(axis=0), points.max(axis=0)
    if low.min() < 0 or high.max() > LONGEST:
        ends = " to ".join(f"({', '.join(f'{x:.4g}' for x in end)})" for end in (low, high))
        text = f"all of it must lie in [0, {LONGEST}] m; move its center, or make its height smaller"
        raise ConfigError(f"the shape reaches from {ends} m: {text}")

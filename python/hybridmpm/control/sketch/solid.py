"""`Solid`: what a closed surface of triangles encloses, as a goal in 3D."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import unmasked
from hybridmpm.errors import SketchError
from hybridmpm.scene import meshes
from hybridmpm.scene.facets import mesh_of
from hybridmpm.scene.fields import LONGEST

Floats: TypeAlias = npt.NDArray[np.float64]

_ALONG = 16
"""Points along the longest side of the box around a solid; those inside sample it."""
_ACROSS = 5
"""Pixels across the width against which a solid is held; an odd number."""
_PIXELS = 64
"""Largest number of pixels along the longest side of the box around a solid."""
_LINES = 64
"""Largest number of lines in the front view."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A goal that the fluid is to fill in 3D: what a closed surface of triangles encloses.

    It has a place in the world, so it is no drawing in the front view. A point is inside where a ray from it
    crosses the triangles an odd number of times (even-odd rule).

    Parameters
    ----------
    vertices : float (V, 3), in [0, 4096], 4 <= V <= 200 000
        Corners of the triangles [m].
    triangles : int (T, 3), 4 <= T <= 200 000
        Indices of three vertices each, all of them the same way round.
    note : str, optional
        A remark.

    Raises
    ------
    SketchError
        A value is out of range, or the surface is not closed; the message names open edges.
    """

    vertices: Floats
    triangles: meshes.Triangles
    note: str | None = None

    kind: ClassVar[Literal["solid"]] = "solid"
    width: ClassVar[None] = None

    def __post_init__(self) -> None:
        vertices = _checked("vertices", self.vertices, np.float64, "numbers")
        triangles = _checked("triangles", self.triangles, np.int64, "whole numbers")
        bad = np.flatnonzero(~((vertices >= 0) & (vertices <= LONGEST)).all(axis=1))
        if bad.size:
            place = vertices[bad[0]].tolist()
            raise SketchError(f"vertices[{bad[0]}] must be three numbers in [0, {LONGEST}], got {place}")
        bad = np.flatnonzero(~((triangles >= 0) & (triangles < len(vertices))).all(axis=1))
        if bad.size:
            allowed, got = f"[0, {len(vertices) - 1}]", triangles[bad[0]].tolist()
            raise SketchError(f"triangles[{bad[0]}] must be indices in {allowed}, got {got}")
        for _, text in meshes.faults(vertices, triangles):
            raise SketchError(f"triangles {text}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)

    @classmethod
    def read(cls, path: str | Path, center: Sequence[float], height: float) -> Self:
        """Return the solid within the surface of a file, .stl, .obj, .ply or .glb, as of modelling programs.

        Vertices at the same place count as one. Axes stay as they are in the file; y is up.

        Parameters
        ----------
        path : path
            File with at most 200 000 triangles.
        center : float (3,)
            Middle of the box around the surface [m].
        height : float in [1e-6, 4096]
            Length of that box along y [m].

        Raises
        ------
        ConfigError
            trimesh is not installed (pip install 'hybridmpm[shapes]'), or the ending is another one.
        DataError
            The file cannot be read, or has no triangles.
        SketchError
            The surface is not closed, or reaches out of [0, 4096] m.
        """
        return cls(**mesh_of(path, center, height))

    def __repr__(self) -> str:
        return f"Solid({len(self.triangles)} triangles around {self.volume:.3g} m^3)"

    @cached_property
    def volume(self) -> float:
        """Volume [m^3]."""
        return abs(meshes.volume(self.vertices, self.triangles))

    @cached_property
    def center(self) -> Floats:
        """Centre of the volume (3,) [m]."""
        return meshes.centroid(self.vertices, self.triangles)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Corners (3,), (3,) of the box around it [m]."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @cached_property
    def outlines(self) -> tuple[Floats, ...]:
        """Closed lines (K, 2) [m] in the front view where the surface turns away, the longest first."""
        lines = meshes.outlines(self.vertices, self.triangles)
        return tuple(sorted(lines, key=lambda line: -np.ptp(line, axis=0).max())[:_LINES])

    @cached_property
    def crosses_itself(self) -> bool:
        """Whether triangles without a common corner cross, so that the even-odd rule decides."""
        return meshes.crossing(self.vertices, self.triangles) is not None

    def covers(self, x: Floats, scale: float = 1.0) -> npt.NDArray[np.bool_]:
        """Return which points (N, 3) [m] lie in the solid grown by a factor from its centre; (N,)."""
        return meshes.contains(self.vertices, self.triangles, self.center + (x - self.center) / scale)

    def covers_drawn(self, x: Floats, scale: float = 1.0) -> npt.NDArray[np.bool_]:
        """Return the same: a solid is given with its depth."""
        return self.covers(x, scale)

    def covers_cells(
        self, lower: Sequence[float], side: float, counts: Sequence[int], scale: float
    ) -> npt.NDArray[np.bool_]:
        """Return which cells have their centre in the solid grown by a factor from its centre.

        Parameters
        ----------
        lower : float (3,)
            Lower corner of the box that the cells make up [m].
        side : float
            Side of a cell [m].
        counts : int (3,)
            Number of cells along each axis.
        scale : float

        Returns
        -------
        bool (X * Y * Z,), those along z first.
        """
        corner = self.center + (np.asarray(lower) - self.center) / scale
        return meshes.raster(self.vertices, self.triangles, corner, side / scale, np.array(counts)).ravel()

    def sample(self) -> Floats:
        """Return points (K, 3) all over the solid [m]."""
        low, high = self.bounds
        side = float((high - low).max()) / _ALONG
        inside = meshes.raster(
            self.vertices, self.triangles, low, side, np.ceil((high - low) / side).astype(int)
        )
        return np.asarray(low + side * (np.argwhere(inside) + 0.5))

    def thin(self, width: float) -> float:
        """Return the share of the volume that a cube of a width [m] within the solid does not reach [-]."""
        inside, across = self._raster(width)
        opened = _spread(~_spread(~inside, across), across)
        return 1.0 - float(opened.sum() / max(1, inside.sum()))

    def narrow(self, width: float) -> float:
        """Return the volume of gaps that a cube of a width [m] does not reach, over that of the solid [-]."""
        inside, across = self._raster(width)
        closed = ~_spread(~_spread(inside, across), across)
        return float(closed.sum() / max(1, inside.sum())) - 1.0

    def _raster(self, width: float) -> tuple[npt.NDArray[np.bool_], int]:
        """Return which of equal cubes have their centre inside, and how many of them a width [m] is."""
        low, high = self.bounds
        pixel = max(width / _ACROSS, float(np.ptp(self.vertices, axis=0).max()) / _PIXELS)
        across = 2 * round((width / pixel - 1) / 2) + 1
        # A margin beyond which nothing spreads.
        counts = np.ceil((high - low) / pixel).astype(int) + 2 * across
        return meshes.raster(self.vertices, self.triangles, low - across * pixel, pixel, counts), across


def _checked(name: str, values: Any, kind: type, what: str) -> npt.NDArray[Any]:
    """Return an array (N, 3) as a read-only copy, or raise `SketchError`."""
    unmasked(name, values, SketchError)
    try:
        array: npt.NDArray[Any] = np.array(values).astype(kind, casting="same_kind")
    except (TypeError, ValueError) as error:
        raise SketchError(f"{name} must be {what}: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3 or not 4 <= len(array) <= meshes.MAX_TRIANGLES:
        raise SketchError(f"{name} must have 4 to {meshes.MAX_TRIANGLES} rows of 3 {what}, got {array.shape}")
    array.flags.writeable = False
    return array


def _spread(cubes: npt.NDArray[np.bool_], across: int) -> npt.NDArray[np.bool_]:
    """Return the cubes (X, Y, Z) that a cube of some of them across reaches from one of `cubes`."""
    for axis in range(3):
        spread = cubes.copy()
        for shift in range(1, across // 2 + 1):
            spread |= np.roll(cubes, shift, axis) | np.roll(cubes, -shift, axis)
        cubes = spread
    return cubes

"""Surfaces of triangles in files of other programs, and the order that their reading makes."""

import io
import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene import meshes
from hybridmpm.scene.fields import Points
from hybridmpm.scene.meshes import Triangles

SUFFIXES = (".stl", ".obj", ".ply", ".glb")
_HEAD, _TRIANGLE = 84, 50
"""Bytes of the head of a binary .stl, whose last four count the triangles, and of a triangle."""
_NEAR = 1e-5
"""Vertices nearer than this part of the size of a surface may count as one [-]."""


def read(path: Path) -> tuple[Points, Triangles]:
    """Return vertices (V, 3) and triangles (T, 3) of a file; each place has one vertex.

    Vertices within a hundred thousandth of the size count as one where the surface is open without that.
    Triangles that are there twice count once. All turn so that they are seen anticlockwise from outside.

    Raises
    ------
    ConfigError
        trimesh is not installed, or the ending of the file is none of these.
    DataError
        The file cannot be read, or has no triangles.
    """
    try:
        import trimesh  # noqa: PLC0415 - an extra
    except ImportError:
        raise ConfigError("reading a surface needs trimesh: pip install 'hybridmpm[shapes]'") from None
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ConfigError(f"files of surfaces end in {', '.join(SUFFIXES)}; got {path.name!r}")
    try:
        found: Any = trimesh.load_mesh(
            io.BytesIO(_tidied(path.read_bytes(), suffix)), file_type=suffix[1:], process=False
        )
        vertices = np.asarray(found.vertices, dtype=np.float64)
        triangles = np.asarray(found.faces, dtype=np.int64).reshape(-1, 3)
        corners = vertices[triangles]
    except Exception as error:  # noqa: BLE001 - readers of damaged files raise whatever comes
        text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise DataError(f"{path} cannot be read as a surface: {text}") from None
    if not len(triangles):
        text = "it may be damaged, or contain points and lines alone; export triangles"
        raise DataError(f"{path} has no triangles: {text}")
    if len(triangles) > meshes.MAX_TRIANGLES:
        text = f"at most {meshes.MAX_TRIANGLES} are allowed; reduce them in a modelling program"
        raise DataError(f"{path} has {len(triangles)} triangles, {text}")
    lost = np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))
    if len(lost):
        text = f"triangle {lost[0]} of {len(triangles)} has a vertex at {_first_lost(corners[lost[0]])}"
        raise DataError(f"{path}: {text}; coordinates must be finite numbers")
    return _in_order(corners.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def _first_lost(corners: Points) -> str:
    corner = corners[~np.isfinite(corners).all(axis=1)][0]
    return "({:g}, {:g}, {:g})".format(*corner)


def _tidied(data: bytes, suffix: str) -> bytes:
    """Return the bytes of a file with what trimesh does not read made plain."""
    if suffix == ".obj":
        # Tabs, comments behind values, and spaces before them.
        lines = (re.sub(rb"[ \t]+", b" ", line.partition(b"#")[0]).strip() for line in data.splitlines())
        return b"\n".join(lines) + b"\n"
    if suffix == ".stl" and len(data) > _HEAD and b"facet" not in data[:1000].lower():
        # Some programs write no count, a wrong one, or notes behind the last triangle.
        count, there = int.from_bytes(data[_HEAD - 4 : _HEAD], "little"), (len(data) - _HEAD) // _TRIANGLE
        if not 0 < count < there or len(data) == _HEAD + there * _TRIANGLE:
            count = there
        return data[: _HEAD - 4] + count.to_bytes(4, "little") + data[_HEAD : _HEAD + count * _TRIANGLE]
    return data


def _in_order(vertices: Points, triangles: Triangles) -> tuple[Points, Triangles]:
    places, corners = _joined(vertices, triangles)
    if not len(corners):
        return places, corners
    if meshes.open_edges(corners):
        near, few = places, corners
        size = np.ptp(places, axis=0).max()
        # Rounding alone parts near places; two grids, half a cell apart along each axis, join them.
        for shift in itertools.product((0.0, 0.5), repeat=3):
            index = np.floor(near / (_NEAR * size) + shift)
            _, first, same = np.unique(index, axis=0, return_index=True, return_inverse=True)
            near, few = near[first], same.ravel()[few]
        near, few = _joined(near, few)
        if not len(few) or meshes.open_edges(few):
            # What is open is refused as it is; its sides would take long to find.
            return places, corners
        places, corners = near, few
    return places, meshes.turned_out(places, corners)


def _joined(vertices: Points, triangles: Triangles) -> tuple[Points, Triangles]:
    """Return the triangles once each, without flat ones, and their vertices, one for each place."""
    places, index = np.unique(vertices[triangles.ravel()], axis=0, return_inverse=True)
    corners = index.reshape(-1, 3)
    # A triangle with two corners at one place has no area, and its other edges cancel.
    corners = corners[~(corners == np.roll(corners, 1, axis=1)).any(axis=1)]
    # The lowest vertex comes first; the way round stays.
    start = corners.argmin(axis=1)[:, None]
    once = np.unique(np.take_along_axis(corners, (start + np.arange(3)) % 3, axis=1), axis=0)
    _, first, times = np.unique(np.sort(once, axis=1), axis=0, return_index=True, return_counts=True)
    # All of them seen from both sides, as some programs draw sheets.
    corners = once[first] if len(times) and times.min() > 1 else once
    used, index = np.unique(corners, return_inverse=True)
    return places[used], index.reshape(-1, 3)

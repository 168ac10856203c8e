"""The surface of each material as a mesh of triangles, for programs that model and render.

A surface encloses particles of 3D scenes. It needs pysplashsurf: pip install 'hybridmpm[surfaces]'.
"""

import importlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ExportError
from hybridmpm.recording import Recording, checked_recording
from hybridmpm.render import palette
from hybridmpm.scene.materials import Elastic
from hybridmpm.scene.particle_types import GOOP, NAMES, RIGID, SAND
from hybridmpm.scene.rigid import RigidBody, placed, turn_of

__all__ = ["Surface", "Surfaces", "require_meshing"]

# Lengths in radii of the particles, which are half their spacing. So single drops and full volumes keep their
# volume alike: a shorter kernel leaves holes in jittered water, a longer one makes drops too large.
_SMOOTHING_LENGTH = 2.2
_CUBE_SIZE = 1.0
_THRESHOLD = 0.6
"""Share of the inside that the smoothed field has at the surface [-]."""
_SMOOTHING_STEPS = 5
"""Steps of weighted smoothing (Loeschner et al. 2023), which level single particles; more shrink drops."""
_NORMAL_STEPS = 4

_SPEED = 0.6 * palette.FAST
"""Speed [m/s] whose colour of the pictures the surfaces have."""
_ROUGHNESS = {RIGID: 0.6, SAND: 0.95, GOOP: 0.5}
_SMOOTH = 0.1
"""Roughness of the other types [-]."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed surface with V vertices and T triangles.

    At sharp edges of rigid bodies each face has vertices of its own, at equal places.
    """

    name: str
    """Material, and the index in `Scene.bodies` or `Scene.rigid`: "water", "elastic_2", "rigid_0"."""
    type: int
    """DeepMind's particle type."""
    vertices: npt.NDArray[np.float32]
    """Points (V, 3) [m]."""
    normals: npt.NDArray[np.float32]
    """Unit vectors (V, 3) out of the material, for smooth shading."""
    triangles: npt.NDArray[np.int32]
    """Indices (T, 3) of the vertices, counterclockwise as seen from outside."""

    @property
    def volume(self) -> float:
        """Volume inside the surface [m^3]."""
        a, b, c = (self.vertices[self.triangles[:, corner]].astype(np.float64) for corner in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


class Surfaces:
    """Surfaces of the states of a recording: of each liquid or sand, and of each elastic or rigid body.

    Emitted elastic matter, and elastic bodies of a coarse simulation, share a surface named "elastic".

    Parameters
    ----------
    recording : Recording
        States of a 3D scene. `record(simulator, 0)` records what a simulator has now.

    Raises
    ------
    ExportError
        The scene is in 2D, `recording` is none, or pysplashsurf is not installed.
    """

    def __init__(self, recording: Recording) -> None:
        check_dim(checked_recording(recording).scene.dim)
        self._meshing = require_meshing()
        self._recording = recording
        self._spacing = recording.spacing or recording.scene.spacing

    def at(self, row: int) -> tuple[Surface, ...]:
        """Return the surfaces of a state; a material without particles has none.

        Surfaces are level sets of the density that the particles have by SPH, meshed by marching cubes and
        smoothed (Loeschner et al. 2023). They lie about half a spacing outside the outermost particles. The
        same state gives the same surfaces on the same machine.
        """
        recording = self._recording
        there = recording.present(row)
        found = []
        for kind in np.unique(recording.types[there]).tolist():
            for name, members in self._parts(kind):
                x = recording.positions[row, there & members]
                if len(x):
                    found.append(self._surface(name, kind, x))
        if recording.rigid is not None:
            pairs = zip(recording.scene.rigid, recording.rigid[row], strict=True)
            found += [_rigid(index, *pair) for index, pair in enumerate(pairs)]
        return tuple(found)

    def _parts(self, kind: int) -> Iterator[tuple[str, npt.NDArray[np.bool_]]]:
        """Yield the name and the members (N,) of each surface of a particle type."""
        members = self._recording.types == kind
        if kind != GOOP:
            yield NAMES[kind], members
            return
        for body, its in self._elastic_bodies:
            yield f"elastic_{body}", its
            members = members & ~its
        yield "elastic", members

    @cached_property
    def _elastic_bodies(self) -> list[tuple[int, npt.NDArray[np.bool_]]]:
        """Indices and members (N,) of the elastic bodies, whose particles are numbered body by body."""
        scene, ids = self._recording.scene, self._recording.ids.astype(np.int64)
        elastic = [i for i, body in enumerate(scene.bodies) if isinstance(body.material, Elastic)]
        if not elastic or not np.isclose(self._spacing, scene.spacing):
            return []
        body = scene.sample().body
        of_bodies = ids < len(body)
        numbers = np.where(of_bodies, body[np.where(of_bodies, ids, 0)], -1)
        return [(index, numbers == index) for index in elastic]

    def _surface(self, name: str, kind: int, x: npt.NDArray[np.float32]) -> Surface:
        mesh, _ = self._meshing.reconstruction_pipeline(
            np.ascontiguousarray(x),
            particle_radius=self._spacing / 2,
            smoothing_length=_SMOOTHING_LENGTH,
            cube_size=_CUBE_SIZE,
            iso_surface_threshold=_THRESHOLD,
            mesh_smoothing_iters=_SMOOTHING_STEPS,
            # Subdomains and threads would put the triangles in an order of their own each time.
            subdomain_grid=False,
            multi_threading=False,
        )
        vertices = np.asarray(mesh.mesh.vertices, dtype=np.float32)
        triangles = np.asarray(mesh.mesh.triangles, dtype=np.int32)
        return Surface(
            name=name,
            type=kind,
            vertices=vertices,
            normals=_normals(vertices.astype(np.float64), triangles),
            triangles=triangles,
        )


def _rigid(index: int, body: RigidBody, numbers: npt.NDArray[np.float64]) -> Surface:
    """Return the surface of a rigid body with its numbers (13,)."""
    vertices, normals, triangles = body.mesh()
    points, which = welded(vertices)
    return Surface(
        name=f"{NAMES[RIGID]}_{index}",
        type=RIGID,
        # Vertices at one place stay there to the last bit, so that readers can merge them.
        vertices=placed(points, numbers).astype(np.float32)[which],
        normals=(normals @ turn_of(numbers).T).astype(np.float32),
        triangles=triangles,
    )


def welded(vertices: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[np.int32]]:
    """Return the different points (P, 3) of vertices (V, 3), and the index (V,) of the point of each."""
    points, which = np.unique(vertices, axis=0, return_inverse=True)
    return points, which.reshape(-1).astype(np.int32)


def _closed(one: Surface) -> Surface:
    """Return a surface whose sharp edges have one vertex a place, with the mean of the normals there."""
    if one.type != RIGID:
        return one
    points, which = welded(one.vertices)
    sums = np.stack([np.bincount(which, axis, len(points)) for axis in one.normals.T], axis=1)
    normals = (sums / np.linalg.norm(sums, axis=1, keepdims=True)).astype(np.float32)
    return replace(one, vertices=points, normals=normals, triangles=which[one.triangles])


def _normals(vertices: npt.NDArray[np.float64], triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.float32]:
    """Return unit normals (V, 3): means of those of the triangles around, weighted by area, and smoothed.

    Smoothing does not turn a normal by more than 60 degrees, which keeps those of single drops outward. The
    vertices of a drop without volume point up.
    """
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    areas = np.linalg.norm(across, axis=1)
    found = plain = _gathered(across, areas, triangles, len(vertices))
    for _ in range(_NORMAL_STEPS):
        found = _gathered(found[triangles].sum(axis=1) * areas[:, None], areas, triangles, len(vertices))
    turned = np.einsum("ij,ij->i", found, plain) < 0.5
    return np.where(turned[:, None], plain, found).astype(np.float32)


def _gathered(
    of_triangles: npt.NDArray[np.float64],
    areas: npt.NDArray[np.float64],
    triangles: npt.NDArray[np.int32],
    count: int,
) -> npt.NDArray[np.float64]:
    """Return unit vectors (count, 3) along the sums of vectors (T, 3) at each vertex."""
    corners = triangles.ravel()
    sums = np.stack([np.bincount(corners, np.repeat(axis, 3), count) for axis in of_triangles.T], axis=1)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    flat = lengths[:, 0] <= 1e-6 * np.bincount(corners, np.repeat(areas, 3), count)
    sums[flat], lengths[flat] = (0.0, 1.0, 0.0), 1.0
    return np.asarray(sums / lengths)


def require_meshing() -> ModuleType:
    """Return the module pysplashsurf, or raise an `ExportError` with the command that installs it."""
    try:
        return importlib.import_module("pysplashsurf")
    except ImportError:
        raise ExportError(
            "surfaces need pysplashsurf; install it with: pip install 'hybridmpm[surfaces]', or write points "
            "as .ply or .vtp"
        ) from None


def check_dim(dim: int) -> None:
    """Refuse scenes in 2D, whose particles enclose no volume, by an `ExportError`."""
    if dim != 3:
        raise ExportError("surfaces need a scene in 3D, and this one is in 2D; write points as .ply or .vtp")


def write_ply(path: Path, recording: Recording, row: int, surfaces: Surfaces) -> None:
    """Write the surfaces of state `row` as one binary PLY; vertices have normals and the particle type."""
    found = [_closed(one) for one in surfaces.at(row)]
    vertices = np.zeros(sum(len(one.vertices) for one in found), dtype=[("x", "<f4", 6), ("type", "u1")])
    faces = np.zeros(sum(len(one.triangles) for one in found), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    first = face = 0
    for one in found:
        some = slice(first, first + len(one.vertices))
        vertices["x"][some] = np.hstack([one.vertices, one.normals])
        vertices["type"][some] = one.type
        faces["corners"][face : face + len(one.triangles)] = one.triangles + first
        first, face = some.stop, face + len(one.triangles)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment frame {recording.frames[row]} time {recording.time(row):.9g} s",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")),
        "property uchar type",
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    path.write_bytes("\n".join(header).encode() + b"\n" + vertices.tobytes() + faces.tobytes())


def write_obj(path: Path, recording: Recording, row: int, surfaces: Surfaces) -> None:
    """Write the surfaces of state `row` as OBJ, each as an object with its name and normals."""
    first = 1
    with path.open("w", encoding="ascii") as file:
        file.write(f"# frame {recording.frames[row]} time {recording.time(row):.9g} s\n")
        for one in map(_closed, surfaces.at(row)):
            file.write(f"o {one.name}\n")
            file.write(_lines("v %.7g %.7g %.7g\n", one.vertices))
            file.write(_lines("vn %.4f %.4f %.4f\n", one.normals))
            file.write(_lines("f %d//%d %d//%d %d//%d\n", np.repeat(one.triangles + first, 2, axis=1)))
            first += len(one.vertices)


def write_glb(path: Path, recording: Recording, row: int, surfaces: Surfaces) -> None:
    """Write the surfaces of state `row` as binary glTF 2.0, each as a node with its name and a material."""
    file = _Gltf(surfaces.at(row))
    file.root["scenes"][0]["extras"] = {"frame": int(recording.frames[row]), "time": recording.time(row)}
    path.write_bytes(file.binary())


class _Gltf:
    """Surfaces as a binary file of glTF 2.0 (Khronos Group 2021, chapter 4)."""

    _FLOAT, _UINT32 = 5126, 5125
    _VERTICES, _INDICES = 34962, 34963

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self._data = bytearray()
        self.root: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "hybridmpm"},
            "scene": 0,
            "scenes": [{}],
        }
        for index, one in enumerate(surfaces):
            closed = _closed(one)
            attributes = {
                "POSITION": self._accessor(closed.vertices, self._FLOAT, self._VERTICES, bounds=True)
            }
            # Without normals faces are flat (section 3.7.2.1), and bodies with sharp edges still closed.
            if len(closed.vertices) == len(one.vertices):
                attributes["NORMAL"] = self._accessor(closed.normals, self._FLOAT, self._VERTICES)
            primitive = {
                "attributes": attributes,
                "indices": self._accessor(closed.triangles.reshape(-1, 1), self._UINT32, self._INDICES),
                "material": index,
            }
            self._add("meshes", {"name": one.name, "primitives": [primitive]})
            self._add("materials", _material(one))
            self._add("nodes", {"name": one.name, "mesh": index})
            self.root["scenes"][0].setdefault("nodes", []).append(index)
        if surfaces:
            self._add("buffers", {"byteLength": len(self._data)})

    def binary(self) -> bytes:
        """Return the header, the chunk of JSON and that of the arrays, in multiples of four bytes."""
        text = json.dumps(self.root, separators=(",", ":")).encode()
        chunks = [(b"JSON", text.ljust(-(-len(text) // 4) * 4))]
        if self._data:
            chunks.append((b"BIN\0", bytes(self._data)))
        body = b"".join(len(data).to_bytes(4, "little") + kind + data for kind, data in chunks)
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body

    def _accessor(
        self, values: npt.NDArray[np.generic], kind: int, target: int, *, bounds: bool = False
    ) -> int:
        """Append an array (n, 1 or 3) of four-byte numbers, and return the index of its accessor."""
        data = values.astype("<f4" if kind == self._FLOAT else "<u4").tobytes()
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data), "target": target}
        accessor = {
            "bufferView": self._add("bufferViews", view),
            "componentType": kind,
            "count": len(values),
            "type": "VEC3" if values.shape[1] == 3 else "SCALAR",
        }
        if bounds:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        self._data += data
        return self._add("accessors", accessor)

    def _add(self, kind: str, item: dict[str, Any]) -> int:
        """Append an item, and return its index among those of its kind."""
        items = self.root.setdefault(kind, [])
        items.append(item)
        return len(items) - 1


def _material(surface: Surface) -> dict[str, Any]:
    """Return the colour of the pictures, which glTF wants linear, as a material."""
    encoded = palette.by_speed(surface.type, np.array(_SPEED)).astype(float)
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return {
        "name": surface.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*linear.round(4).tolist(), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": _ROUGHNESS.get(surface.type, _SMOOTH),
        },
    }


def _lines(row: str, values: npt.NDArray[np.generic]) -> str:
    """Return a line for each row of an array (n, k)."""
    return (row * len(values)) % tuple(values.ravel().tolist())

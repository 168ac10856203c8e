"""One state as a point cloud: PLY for mesh tools, VTP for ParaView. In 2D, z is 0."""

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm.recording import Recording
from hybridmpm.scene.particle_types import RIGID
from hybridmpm.scene.rigid import placed, velocities_of


@dataclass(frozen=True, eq=False)
class Cloud:
    """One state of N particles in D dimensions."""

    frame: int
    time: float
    """Simulated time [s]."""
    positions: npt.NDArray[np.float32]
    """Positions (N, D) [m]."""
    velocities: npt.NDArray[np.float32]
    """Velocities (N, D) [m/s]."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,)."""

    @classmethod
    def of(cls, recording: Recording, row: int) -> Self:
        """Take state `row` of a recording, with the particles that are there.

        Rigid bodies come last, as points of type 0 that fill them.
        """
        there = recording.present(row)
        x, v = [recording.positions[row, there]], [recording.velocities[row, there]]
        types = [recording.types[there]]
        if recording.rigid is not None:
            spacing = recording.spacing or recording.scene.spacing
            for body, numbers in zip(recording.scene.rigid, recording.rigid[row], strict=True):
                points = placed(body.filling(spacing), numbers)
                x.append(points.astype(np.float32))
                v.append(velocities_of(points, numbers).astype(np.float32))
                types.append(np.full(len(points), RIGID, dtype=np.uint8))
        return cls(
            frame=int(recording.frames[row]),
            time=recording.time(row),
            positions=np.concatenate(x),
            velocities=np.concatenate(v),
            types=np.concatenate(types),
        )

    def ply(self) -> bytes:
        """Return the state as binary PLY; each vertex has x y z vx vy vz (float) and type (uchar)."""
        fields = [(name, "<f4") for name in ("x", "y", "z", "vx", "vy", "vz")] + [("type", "u1")]
        vertices = np.zeros(len(self.types), dtype=fields)
        x, v = _in_3d(self.positions), _in_3d(self.velocities)
        for axis, name in enumerate("xyz"):
            vertices[name], vertices[f"v{name}"] = x[:, axis], v[:, axis]
        vertices["type"] = self.types
        header = [
            "ply",
            "format binary_little_endian 1.0",
            f"comment frame {self.frame} time {self.time:.9g} s",
            f"element vertex {len(vertices)}",
            *(f"property float {name}" for name, _ in fields[:-1]),
            "property uchar type",
            "end_header",
        ]
        return "\n".join(header).encode() + b"\n" + vertices.tobytes()

    def vtp(self) -> bytes:
        """Return the state as VTK PolyData, with point arrays `velocity` and `type` and field `TimeValue`."""
        x, v = _in_3d(self.positions), _in_3d(self.velocities)
        count = len(x)
        time = np.array([self.time])
        text = f"""<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<PolyData>
<FieldData>{_array("TimeValue", time, tuples=True)}</FieldData>
<Piece NumberOfPoints="{count}" NumberOfVerts="{count}">
<Points>{_array("Points", x)}</Points>
<Verts>{_array("connectivity", np.arange(count))}{_array("offsets", np.arange(1, count + 1))}</Verts>
<PointData Vectors="velocity" Scalars="type">
{_array("velocity", v)}{_array("type", self.types)}
</PointData>
</Piece>
</PolyData>
</VTKFile>
"""
        return text.encode("ascii")


def write_ply(path: Path, recording: Recording, row: int) -> None:
    """Write state `row` as `Cloud.ply`."""
    path.write_bytes(Cloud.of(recording, row).ply())


def write_vtp(path: Path, recording: Recording, row: int) -> None:
    """Write state `row` as `Cloud.vtp`."""
    path.write_bytes(Cloud.of(recording, row).vtp())


def _array(name: str, values: npt.NDArray[np.generic], *, tuples: bool = False) -> str:
    """Return an array as inline XML: the base64 of its size in bytes (UInt64) and its little-endian bytes."""
    kinds = {"f4": "Float32", "f8": "Float64", "i8": "Int64", "u1": "UInt8"}
    kind = kinds[values.dtype.str[1:]]
    data = values.astype(values.dtype.newbyteorder("<")).tobytes()
    encoded = base64.b64encode(np.array(len(data), dtype="<u8").tobytes() + data).decode()
    size = f' NumberOfTuples="{len(values)}"' if tuples else ""
    parts = values.shape[1] if values.ndim == 2 else 1
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{parts}"{size} format="binary">'
        f"{encoded}</DataArray>"
    )


def _in_3d(vectors: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    return np.pad(vectors, [(0, 0), (0, 3 - vectors.shape[1])])

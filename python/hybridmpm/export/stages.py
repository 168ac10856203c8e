"""Particles as points of Universal Scene Description, for programs of film and animation.

It needs usd-core: pip install 'hybridmpm[usd]'.
"""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from hybridmpm.errors import ExportError
from hybridmpm.recording import Recording
from hybridmpm.render import palette
from hybridmpm.scene.particle_types import NAMES, RIGID


def require_usd() -> tuple[ModuleType, ...]:
    """Return modules of usd-core, or raise an `ExportError` with the command that installs it."""
    try:
        from pxr import Gf, Usd, UsdGeom, Vt  # noqa: PLC0415 - an extra
    except ImportError:
        raise ExportError(
            "USD needs usd-core; install it with: pip install 'hybridmpm[usd]', or write .ply or .vtp"
        ) from None
    return Gf, Usd, UsdGeom, Vt


def write_usd(path: Path, recording: Recording) -> None:
    """Write all states to one file: points for each material, a mesh for each rigid body, sample by sample.

    Points have ids, velocities [m/s] and a width [m]; y is up and the unit is the metre. The time code of a
    state is its frame.
    """
    gf, usd, geom, vt = require_usd()
    # `CreateNew` would refuse a name that a stage in memory still has.
    stage = usd.Stage.CreateInMemory()
    geom.SetStageUpAxis(stage, geom.Tokens.y)
    geom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(1.0 / recording.scene.frame_dt)
    stage.SetStartTimeCode(float(recording.frames[0]))
    stage.SetEndTimeCode(float(recording.frames[-1]))
    root = geom.Xform.Define(stage, "/particles")
    stage.SetDefaultPrim(root.GetPrim())
    for kind in np.unique(recording.types).tolist():
        members = recording.types == kind
        points = geom.Points.Define(stage, f"/particles/{NAMES[kind]}")
        points.CreateWidthsAttr([recording.spacing or recording.scene.spacing])
        points.SetWidthsInterpolation(geom.Tokens.constant)
        color = palette.by_speed(kind, np.full(1, 0.6 * palette.FAST, np.float32))[0]
        points.CreateDisplayColorAttr([gf.Vec3f(*map(float, color))])
        for row, frame in enumerate(recording.frames.tolist()):
            there = members & recording.present(row)
            samples: list[tuple[Any, Any]] = [
                (points.CreatePointsAttr(), _vectors(vt, recording.positions[row, there])),
                (points.CreateVelocitiesAttr(), _vectors(vt, recording.velocities[row, there])),
                (points.CreateIdsAttr(), vt.Int64Array.FromNumpy(recording.ids[there].astype(np.int64))),
            ]
            for attribute, values in samples:
                attribute.Set(values, float(frame))
    _write_bodies(stage, recording)
    stage.GetRootLayer().Export(str(path))


def _write_bodies(stage: Any, recording: Recording) -> None:
    """Add a mesh for each rigid body, which moves by its transformation: of flat polygons in 2D."""
    if recording.rigid is None:
        return
    gf, _, geom, vt = require_usd()
    for index, body in enumerate(recording.scene.rigid):
        mesh = geom.Mesh.Define(stage, f"/particles/{NAMES[RIGID]}_{index}")
        if recording.scene.dim == 2:
            vertices = np.pad(body.own(body.outline()), [(0, 0), (0, 1)])
            faces = np.arange(len(vertices), dtype=np.int32)[None]
        else:
            vertices, normals, faces = body.mesh()
            mesh.CreateNormalsAttr(_vectors(vt, normals.astype(np.float32)))
            mesh.SetNormalsInterpolation(geom.Tokens.vertex)
        mesh.CreateSubdivisionSchemeAttr(geom.Tokens.none)
        mesh.CreatePointsAttr(_vectors(vt, vertices.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr(vt.IntArray([faces.shape[1]] * len(faces)))
        mesh.CreateFaceVertexIndicesAttr(vt.IntArray.FromNumpy(faces.ravel()))
        mesh.CreateDisplayColorAttr([gf.Vec3f(*map(float, palette.RIGID))])
        place, turn = mesh.AddTranslateOp(geom.XformOp.PrecisionDouble), mesh.AddOrientOp()
        for frame, numbers in zip(recording.frames.tolist(), recording.rigid[:, index].tolist(), strict=True):
            place.Set(gf.Vec3d(*numbers[:3]), float(frame))
            turn.Set(gf.Quatf(*numbers[3:7]), float(frame))


def _vectors(vt: ModuleType, x: np.ndarray[Any, np.dtype[np.float32]]) -> Any:
    """Return vectors (N, D) as USD's of three numbers; those of the plane have z = 0."""
    flat = np.zeros((len(x), 3), dtype=np.float32)
    flat[:, : x.shape[1]] = x
    return vt.Vec3fArray.FromNumpy(flat)

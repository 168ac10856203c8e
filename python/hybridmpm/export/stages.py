"""Particles as points of Universal Scene Description, for programs of film and animation.

It needs usd-core: pip install 'hybridmpm[usd]'.
"""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ExportError
from hybridmpm.export.surfaces import welded
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
    width = recording.spacing or recording.scene.spacing
    for kind in np.unique(recording.types).tolist():
        members = recording.types == kind
        points = geom.Points.Define(stage, f"/particles/{NAMES[kind]}")
        points.CreateWidthsAttr([width])
        points.SetWidthsInterpolation(geom.Tokens.constant)
        color = palette.by_speed(kind, np.full(1, 0.6 * palette.FAST, np.float32))[0]
        extent = points.CreateExtentAttr()
        points.CreateDisplayColorAttr([gf.Vec3f(*map(float, color))])
        for row, frame in enumerate(recording.frames.tolist()):
            there = members & recording.present(row)
            samples: list[tuple[Any, Any]] = [
                (extent, _extent(vt, recording.positions[row, there], width)),
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
            points = body.own(body.outline())
            faces = np.arange(len(points), dtype=np.int32)[None]
        else:
            vertices, normals, faces = body.mesh()
            # Faces that meet at a sharp edge share its vertices, not its normals.
            mesh.CreateNormalsAttr(_vectors(vt, normals[faces.ravel()].astype(np.float32)))
            mesh.SetNormalsInterpolation(geom.Tokens.faceVarying)
            points, which = welded(vertices)
            faces = which[faces]
        mesh.CreateSubdivisionSchemeAttr(geom.Tokens.none)
        mesh.CreatePointsAttr(_vectors(vt, points.astype(np.float32)))
        mesh.CreateExtentAttr(_extent(vt, points.astype(np.float32)))
        mesh.CreateFaceVertexCountsAttr(vt.IntArray([faces.shape[1]] * len(faces)))
        mesh.CreateFaceVertexIndicesAttr(vt.IntArray.FromNumpy(faces.ravel()))
        mesh.CreateDisplayColorAttr([gf.Vec3f(*map(float, palette.RIGID))])
        place, turn = mesh.AddTranslateOp(geom.XformOp.PrecisionDouble), mesh.AddOrientOp()
        for frame, numbers in zip(recording.frames.tolist(), recording.rigid[:, index].tolist(), strict=True):
            place.Set(gf.Vec3d(*numbers[:3]), float(frame))
            turn.Set(gf.Quatf(*numbers[3:7]), float(frame))


def _extent(vt: ModuleType, x: npt.NDArray[np.float32], width: float = 0.0) -> Any:
    """Return two corners of a box around points (N, D) of a width [m], by which readers frame what is seen.

    USD computes none for points that share one width. Without points it is USD's empty box.
    """
    if not len(x):
        most = np.finfo(np.float32).max
        return _vectors(vt, np.array([[most] * 3, [-most] * 3], dtype=np.float32))
    around = np.pad(np.stack([x.min(axis=0), x.max(axis=0)]), [(0, 0), (0, 3 - x.shape[1])])
    return _vectors(vt, around + np.array([[-width / 2], [width / 2]], dtype=np.float32))


def _vectors(vt: ModuleType, x: npt.NDArray[np.float32]) -> Any:
    """Return vectors (N, D) as USD's of three numbers; those of the plane have z = 0."""
    flat = np.zeros((len(x), 3), dtype=np.float32)
    flat[:, : x.shape[1]] = x
    return vt.Vec3fArray.FromNumpy(flat)

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
from hybridmpm.scene.particle_types import NAMES


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
    """Write all states to one file: a prim of points for each material, with a sample for each state.

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
    stage.GetRootLayer().Export(str(path))


def _vectors(vt: ModuleType, x: np.ndarray[Any, np.dtype[np.float32]]) -> Any:
    """Return vectors (N, D) as USD's of three numbers; those of the plane have z = 0."""
    flat = np.zeros((len(x), 3), dtype=np.float32)
    flat[:, : x.shape[1]] = x
    return vt.Vec3fArray.FromNumpy(flat)

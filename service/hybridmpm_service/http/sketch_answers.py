"""What the service answers to a sketch: the sketch as it was understood, and the motion that it gives."""

from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from hybridmpm.control import Arrow, ControlledTrajectory, Sketch


class TrajectoryBody(BaseModel):
    """A sketch as it was understood, and the motion that it gives to the session."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "sketch": {"kind": "arrow", "points": [[0.3, 0.5], [0.6, 0.7]]},
                    "frames": 2,
                    "first_frame": 12,
                    "mean_force": [[8.1, 16.2], [8.1, 16.2]],
                    "target_displacement": [0.3, 0.2],
                    "displacement": [0.29, 0.18],
                    "centroids": [[0.41, 0.52], [0.5, 0.6], [0.7, 0.7]],
                    "frame_indices": [0, 2],
                    "positions": [[[0.4, 0.5]], [[0.7, 0.7]]],
                }
            ]
        }
    )

    sketch: dict[str, Any] = Field(
        description='The sketch as it was understood: an "arrow" with `points` [m], or an "ellipse" with '
        "`center` [m], semi-`axes` [m] and `angle` [rad]. In 3D `widths` or `width` [pixels] give the depth."
    )
    frames: int = Field(description="Number of frames that the sketch steers.")
    first_frame: int = Field(description="Frame of the session at which the sketch begins to steer.")
    mean_force: list[list[float]] = Field(
        description="Acceleration that steers, besides gravity, as the mean over the mass of the particles; "
        "[frame][axis], `frames` rows [m/s^2]."
    )
    target_displacement: list[float] = Field(
        description="Displacement of the centre of mass that the sketch asks for [m]."
    )
    displacement: list[float] = Field(
        description="Displacement of the centre of mass that the motion reaches [m]."
    )
    centroids: list[list[float]] = Field(
        description="Centre of mass at the start and after each frame; [frame][axis], `frames` + 1 rows [m]."
    )
    frame_indices: list[int] = Field(
        description="Frame of each row of `positions`, counted from `first_frame`; chosen by `stride`."
    )
    positions: list[list[list[float]]] = Field(
        description="Positions of the particles in these frames; [row][particle][axis] [m]."
    )


def sketch_body(sketch: Sketch) -> dict[str, Any]:
    """Describe a sketch as it was understood."""
    if isinstance(sketch, Arrow):
        body: dict[str, Any] = {"kind": sketch.kind, "points": sketch.points.tolist()}
        if sketch.widths is not None:
            body["widths"] = sketch.widths.tolist()
        return body
    body = {"kind": sketch.kind, "center": sketch.center.tolist(), "axes": sketch.axes.tolist()}
    body["angle"] = sketch.angle
    if sketch.width is not None:
        body["width"] = sketch.width
    return body


def trajectory_arrays(plan: ControlledTrajectory, stride: int) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays that JSON and npz share; positions are thinned as `_frame_indices` says."""
    indices = _frame_indices(plan, stride)
    return {
        "positions": plan.positions[indices],
        "frame_indices": indices,
        "centroids": plan.centroids,
        "mean_force": plan.mean_force,
        "target_displacement": plan.target_displacement,
        "displacement": plan.displacement,
    }


def thinned_force(plan: ControlledTrajectory, stride: int) -> npt.NDArray[np.float32]:
    """Return the force of a trajectory, (D,) where it is one constant, else thinned as the positions are.

    Row i of (F - 1, N, D) is then the force of the frame that begins with row i of the positions. With a
    stride of 1 that is the whole force, which `Simulator.advance` takes.
    """
    return plan.force if plan.force.ndim == 1 else plan.force[_frame_indices(plan, stride)[:-1]]


def _frame_indices(plan: ControlledTrajectory, stride: int) -> npt.NDArray[np.int64]:
    """Return each `stride`-th frame from the start on, and the last."""
    return np.unique(np.append(np.arange(0, plan.frames + 1, stride), plan.frames))

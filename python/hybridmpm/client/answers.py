"""Answers with many numbers, as arrays."""

import io
from dataclasses import dataclass
from typing import Any

import httpx
import numpy as np
import numpy.typing as npt

from hybridmpm._support.packing import READING


@dataclass(frozen=True, eq=False)
class Particles:
    """All N particles of a session in D dimensions, at one frame."""

    frame: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    positions: npt.NDArray[np.float32]
    """Positions (N, D) [m]."""
    velocities: npt.NDArray[np.float32]
    """Velocities (N, D) [m/s]."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid."""
    ids: npt.NDArray[np.uint64]
    """Numbers (N,) that the particles keep."""
    rigid: npt.NDArray[np.float64]
    """Numbers (B, 13) of the rigid bodies: centre of mass [m], unit quaternion of the turn with the scalar
    first, velocity [m/s], angular velocity [rad/s], each with the components in space."""

    @classmethod
    def of(cls, answer: httpx.Response) -> "Particles":
        """Read the npz of an answer."""
        arrays = _arrays(answer)
        return cls(int(arrays.pop("frame")), float(arrays.pop("time")), **arrays)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The motion of a sketch that was followed on a copy of a session, in T frames.

    F is the number of frames with positions.
    """

    positions: npt.NDArray[np.float32]
    """Positions (F, N, D) [m]; NaN for a particle that has left."""
    force: npt.NDArray[np.float32]
    """Accelerations of the particles (F - 1, N, D), or (D,) where it is one for all [m/s^2]."""
    frame_indices: npt.NDArray[np.int64]
    """Frames (F,) of the positions, from 0 to T."""
    centroids: npt.NDArray[np.float64]
    """Centres of mass (T + 1, D) [m]."""
    mean_force: npt.NDArray[np.float64]
    """Mean acceleration in each frame (T, D) [m/s^2]."""
    target_displacement: npt.NDArray[np.float64]
    """Displacement of the centre of mass that the sketch describes (D,) [m]."""
    displacement: npt.NDArray[np.float64]
    """Displacement of the centre of mass (D,) [m]."""

    @classmethod
    def of(cls, answer: httpx.Response) -> "Trajectory":
        """Read the npz of an answer."""
        return cls(**_arrays(answer))


def _arrays(answer: httpx.Response) -> dict[str, Any]:
    with READING, np.load(io.BytesIO(answer.content), allow_pickle=False) as file:
        return {name: file[name] for name in file.files}

"""Recordings as numpy's .npz."""

from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm.recording import Recording


def write_npz(path: Path, recording: Recording) -> None:
    """Write all states of a recording as arrays.

    The arrays are `positions` [m] and `velocities` [m/s], float32 (F, N, D); DeepMind's particle types
    `types`, uint8 (N,); `mass` [kg], float32 (N,); `ids`, uint64 (N,); the frame numbers `frames`, int64
    (F,); `frame_dt` [s]; `scene`, the scene's JSON; and, with rigid bodies, `rigid`, float64 (F, B, 13), see
    `Recording.rigid`. Positions and velocities of a particle are NaN in
    states before an emitter made it and after a sink removed it.
    """
    rigid: dict[str, Any] = {} if recording.rigid is None else {"rigid": recording.rigid}
    with path.open("wb") as file:
        np.savez(
            file,
            positions=recording.positions,
            velocities=recording.velocities,
            ids=recording.ids,
            types=recording.types,
            mass=recording.mass,
            frames=recording.frames,
            frame_dt=np.float64(recording.scene.frame_dt),
            scene=np.array(recording.scene.to_json()),
            **rigid,
        )

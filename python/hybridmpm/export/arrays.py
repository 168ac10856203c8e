"""Recordings as numpy's .npz."""

from pathlib import Path

import numpy as np

from hybridmpm.recording import Recording


def write_npz(path: Path, recording: Recording) -> None:
    """Write all states.

    Arrays: `positions`, `velocities` float32 (F, N, D) in m and m/s, `types` uint8 (N,) of DeepMind,
    `mass` float32 (N,) in kg, `ids` uint64 (N,), `frames` int64 (F,), `frame_dt` [s], and
    `scene`, the scene's JSON. A particle is NaN in states before an emitter made it or after a sink
    removed it.
    """
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
        )

"""Pictures of trajectories: a film of one, or a sheet with several at a few moments."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm._support.files import replacing
from hybridmpm.data.control import pixels
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.recording import Recording
from hybridmpm.render import side_by_side, view_of
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC

_RADIUS_SPACINGS = {2: 3.0, 3: 2.0}
"""Usual connectivity radius of data sets [spacings], by dimension; from it follows a particle's size."""
_GAP = 6
"""Distance between rows of a sheet [pixels]."""


def recording_of(trajectory: Trajectory, about: Mapping[str, Any]) -> Recording:
    """Turn a trajectory into a recording, which `export` can draw.

    If the trajectory has its scene, the recording has it, too, and no kinematic particles. Else its scene is
    the empty box of the metadata, scaled into the unit square where needed, and kinematic particles are kept.

    Parameters
    ----------
    trajectory : Trajectory
    about : mapping
        Metadata of the data set.
    """
    dt = float(about["dt"])
    positions = trajectory.positions.astype(np.float64)
    if trajectory.scene is not None:
        scene, shown = trajectory.scene, trajectory.types != KINEMATIC
    else:
        scene, positions = _boxed(positions, about, dt)
        shown = np.ones(len(trajectory.types), dtype=np.bool_)
    positions = positions[:, shown]
    velocities = np.diff(positions, axis=0, append=positions[-1:]) / dt
    stride = max(1, round(dt / scene.frame_dt))
    return Recording(
        scene=scene,
        ids=np.arange(int(shown.sum()), dtype=np.uint64),
        types=trajectory.types[shown].astype(np.uint8),
        mass=np.ones(int(shown.sum()), dtype=np.float32),
        frames=np.arange(len(positions)) * stride,
        positions=positions.astype(np.float32),
        velocities=velocities.astype(np.float32),
    )


def write_sheet(
    path: Path,
    recordings: Sequence[Recording],
    labels: Sequence[str],
    *,
    moments: int,
    width: int,
    sketches: Sequence[bytes | None] = (),
) -> None:
    """Write a .png with one row for each recording: `moments` pictures, evenly spread over its time.

    Parameters
    ----------
    path : Path
    recordings : sequence of Recording
    labels : sequence of str
        Text at the start of each row.
    moments : int
        Number of pictures in a row.
    width : int
        Width of a picture [pixels].
    sketches : sequence of PNG, optional
        Picture to begin each row with; None for rows without.

    Raises
    ------
    ExportError
        The file cannot be written.
    """
    first = sketches or [None] * len(recordings)
    rows = [_row(*parts, moments, width) for parts in zip(recordings, labels, first, strict=True)]
    widest = max(row.shape[1] for row in rows)
    white = np.full((_GAP, widest, 3), 255, dtype=np.uint8)
    parts = [part for row in rows for part in (white, _padded(row, widest))][1:]
    with replacing(path) as part:
        Image.fromarray(np.concatenate(parts)).save(part, optimize=True)


def _row(
    recording: Recording, label: str, sketch: bytes | None, moments: int, width: int
) -> npt.NDArray[np.uint8]:
    view = view_of(recording.scene, recording.types, width)
    pictures: list[npt.NDArray[np.uint8]] = []
    for state in np.linspace(0, len(recording.frames) - 1, moments).round().astype(int):
        time = recording.time(int(state))
        picture = Image.fromarray(view.draw(recording.positions[state], recording.velocities[state], time))
        text = f"{label}, {time:.2f} s" if not pictures else f"{time:.2f} s"
        size = max(10, width // 20)
        ImageDraw.Draw(picture).text((size, size // 2), text, fill=(235, 240, 250), font_size=size)
        pictures.append(np.asarray(picture))
    if sketch is not None:
        height = len(pictures[0])
        drawn = Image.fromarray(pixels(sketch)).convert("RGB").resize((height, height))
        pictures.insert(0, np.asarray(drawn))
    return side_by_side(pictures)


def _padded(row: npt.NDArray[np.uint8], width: int) -> npt.NDArray[np.uint8]:
    return np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0)), constant_values=255)


def _boxed(
    positions: npt.NDArray[np.float64], about: Mapping[str, Any], dt: float
) -> tuple[Scene, npt.NDArray[np.float64]]:
    """Return a scene with the box of the metadata, and the positions (F, N, D) [m] scaled into it."""
    dim = positions.shape[2]
    lower, upper = np.array(about["bounds"], dtype=np.float64).T
    scale, offset = 1.0, np.zeros(dim)
    if (lower < 0).any() or (upper > 1).any():
        scale, offset = 0.8 / float((upper - lower).max()), lower
        lower, upper = np.full(dim, 0.1), 0.1 + scale * (upper - lower)
        positions = 0.1 + scale * (positions - offset)
    spacing = scale * float(about["default_connectivity_radius"]) / _RADIUS_SPACINGS[dim]
    walls = {"lower": lower.tolist(), "upper": upper.tolist()}
    # A scene needs a body; bodies are not drawn.
    filled = {"shape": "box", "material": {"kind": "water"}, **walls}
    scene = Scene.parse(
        {
            "name": "data",
            "dim": dim,
            "resolution": int(np.clip(round(0.5 / spacing), 8, 1024 if dim == 2 else 256)),
            "frame_dt": float(np.clip(dt, 1e-6, 0.1)),
            "walls": walls,
            "bodies": [filled],
            "max_particles": 10_000_000,
        }
    )
    return scene, positions

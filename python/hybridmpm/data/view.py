"""Pictures of trajectories: films of one, and a sheet of moments of several."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm._support.files import replacing
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.recording import Recording
from hybridmpm.render import side_by_side, view_of
from hybridmpm.scene import Scene
from hybridmpm.scene.particle_types import KINEMATIC

_RADIUS_SPACINGS = {2: 3.0, 3: 2.0}
"""Connectivity radii in spacings, about what data sets have: it tells how large a particle is."""
_GAP = 6
"""Between rows of a sheet [pixels]."""


def recording_of(trajectory: Trajectory, about: Mapping[str, Any]) -> Recording:
    """Turn a trajectory into what `export` writes films of.

    Where the trajectory has its scene, that is drawn, obstacles and all; otherwise its box, scaled to fit the
    unit square, with kinematic particles as they are.

    Parameters
    ----------
    trajectory : Trajectory
    about : mapping
        The data set's metadata.
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
    path: Path, recordings: Sequence[Recording], labels: Sequence[str], *, moments: int, width: int
) -> None:
    """Write a .png of one row a recording, `moments` pictures of `width` pixels each, evenly spread in time.

    Raises
    ------
    ExportError
        The folder refuses the file.
    """
    rows = [_row(*pair, moments, width) for pair in zip(recordings, labels, strict=True)]
    widest = max(row.shape[1] for row in rows)
    white = np.full((_GAP, widest, 3), 255, dtype=np.uint8)
    parts = [part for row in rows for part in (white, _padded(row, widest))][1:]
    with replacing(path) as part:
        Image.fromarray(np.concatenate(parts)).save(part, optimize=True)


def _row(recording: Recording, label: str, moments: int, width: int) -> npt.NDArray[np.uint8]:
    view = view_of(recording.scene, recording.types, width)
    pictures: list[npt.NDArray[np.uint8]] = []
    for state in np.linspace(0, len(recording.frames) - 1, moments).round().astype(int):
        time = recording.time(int(state))
        picture = Image.fromarray(view.draw(recording.positions[state], recording.velocities[state], time))
        text = f"{label}, {time:.2f} s" if not pictures else f"{time:.2f} s"
        size = max(10, width // 20)
        ImageDraw.Draw(picture).text((size, size // 2), text, fill=(235, 240, 250), font_size=size)
        pictures.append(np.asarray(picture))
    return side_by_side(pictures)


def _padded(row: npt.NDArray[np.uint8], width: int) -> npt.NDArray[np.uint8]:
    return np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0)), constant_values=255)


def _boxed(
    positions: npt.NDArray[np.float64], about: Mapping[str, Any], dt: float
) -> tuple[Scene, npt.NDArray[np.float64]]:
    """Build an empty scene with the box of the metadata, and scale positions into it."""
    dim = positions.shape[2]
    lower, upper = np.array(about["bounds"], dtype=np.float64).T
    scale, offset = 1.0, np.zeros(dim)
    if (lower < 0).any() or (upper > 1).any():
        scale, offset = 0.8 / float((upper - lower).max()), lower
        lower, upper = np.full(dim, 0.1), 0.1 + scale * (upper - lower)
        positions = 0.1 + scale * (positions - offset)
    spacing = scale * float(about["default_connectivity_radius"]) / _RADIUS_SPACINGS[dim]
    walls = {"lower": lower.tolist(), "upper": upper.tolist()}
    # A scene needs a body, which is not drawn.
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

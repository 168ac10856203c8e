"""NeuralMPM's layout: an HDF5 file for each trajectory, with walls and obstacles apart from moving particles.

`SPLIT/sim_I.h5` has `particles` (F, N, D or more), `boundary` (F or 1, B, D or more) and `types`, which are
(N,) or, with the boundary first, (B + N,). Type 0 is the boundary; other types are DeepMind's.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm._support.files import replacing
from hybridmpm.data import hdf5, metadata
from hybridmpm.data.formats.layout import Format, chosen, in_order
from hybridmpm.data.trajectory import Place, Trajectory
from hybridmpm.errors import DataError
from hybridmpm.scene.particle_types import GOOP, KINEMATIC, SAND, WATER, translated

_FROM = {0: KINEMATIC, WATER: WATER, SAND: SAND, GOOP: GOOP}
_TO = {KINEMATIC: 0, WATER: WATER, SAND: SAND, GOOP: GOOP}
_NAME = re.compile(r"sim_(\d+)\.h5")


def _files(folder: Path, split: str) -> list[Path]:
    found = [
        (int(match[1]), path) for path in (folder / split).glob("*") if (match := _NAME.fullmatch(path.name))
    ]
    return [path for _, path in sorted(found)]


def _splits(folder: Path) -> list[str]:
    return in_order(path.name for path in folder.iterdir() if path.is_dir() and _files(folder, path.name))


def _count(folder: Path, split: str) -> int:
    return len(_files(folder, split))


def _read(folder: Path, split: str, numbers: Iterable[int] | None) -> Iterator[Trajectory]:
    files = _files(folder, split)
    dim = int(metadata.read(folder)["dim"])
    for number in chosen(numbers, len(files), folder / split):
        with hdf5.reading(files[number]) as file:
            yield _trajectory(file, files[number], dim)


def _trajectory(file: Any, path: Path, dim: int) -> Trajectory:
    particles = _positions(file, "particles", path, dim)
    boundary = _positions(file, "boundary", path, dim)
    if len(boundary) not in {1, len(particles)}:
        raise DataError(f"{path}: boundary must have 1 or {len(particles)} frames, got {len(boundary)}")
    types = _moving_types(hdf5.read_array(file, "types", path), particles, boundary, path)
    fixed = np.broadcast_to(boundary, (len(particles), *boundary.shape[1:]))
    key, count = "force", boundary.shape[1]
    force = hdf5.read_array(file, key, path).astype(np.float32) if key in file else None
    if force is not None and force.ndim == 3:
        force = np.concatenate([force, np.zeros((len(force), count, dim), np.float32)], axis=1)
    return Trajectory(
        positions=np.concatenate([particles, fixed], axis=1),
        types=np.concatenate([types, np.full(count, KINEMATIC, np.int64)]),
        force=force,
        place=Place(str(path), position="particles and boundary", types="types"),
    )


def _positions(file: Any, key: str, path: Path, dim: int) -> npt.NDArray[np.float32]:
    found = hdf5.read_array(file, key, path)
    if found.ndim != 3 or found.shape[2] < dim:
        raise DataError(
            f"{path}: {key} must have shape (frames, particles, {dim} or more), got {found.shape}"
        )
    return found[..., :dim].astype(np.float32)


def _moving_types(
    types: npt.NDArray[Any], particles: npt.NDArray[Any], boundary: npt.NDArray[Any], path: Path
) -> npt.NDArray[np.int64]:
    moving, fixed = particles.shape[1], boundary.shape[1]
    if types.shape not in {(moving,), (moving + fixed,)}:
        raise DataError(
            f"{path}: types must name {moving} particles, or {moving + fixed} with the boundary, got shape "
            f"{types.shape}"
        )
    return translated(types[len(types) - moving :].astype(np.int64), _FROM, where=f"{path}: types")


def _write(folder: Path, split: str, trajectories: Iterable[Trajectory]) -> None:
    (folder / split).mkdir(parents=True, exist_ok=True)
    for number, trajectory in enumerate(trajectories):
        with replacing(folder / split / f"sim_{number}.h5") as part, hdf5.writing(part) as file:
            moving = trajectory.types != KINEMATIC
            types = translated(trajectory.types[moving], _TO, where=trajectory.place.file)
            hdf5.write_array(file, "particles", trajectory.positions[:, moving])
            # NeuralMPM's reader joins both arrays along the particles, so both need all frames.
            hdf5.write_array(file, "boundary", trajectory.positions[:, ~moving])
            hdf5.write_array(file, "types", types)
            if trajectory.force is not None:
                hdf5.write_array(file, "force", trajectory.force[:, moving])


NEURALMPM = Format(
    name="neuralmpm",
    text="{train,valid,test}/sim_I.h5, boundary particles apart",
    splits=_splits,
    count=_count,
    read=_read,
    write=_write,
    keeps=frozenset({"force"}),
)

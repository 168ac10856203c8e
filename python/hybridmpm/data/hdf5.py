"""Reading and writing trajectories as HDF5 groups, with errors that name file and key.

h5py is imported on first use: the extra `data` installs it, and no other part of the library needs it.
"""

import importlib
import io
import os
import re
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.data.control import Control
from hybridmpm.data.trajectory import Place, Trajectory
from hybridmpm.errors import ConfigError, DataError, SketchError
from hybridmpm.scene import Scene

_CHUNK_BYTES = 2**18
"""Size of a chunk before compression [bytes]; a training sample of 7 frames then reads few chunks."""
_LEVEL = 1
"""Level of gzip: once the bytes are shuffled, higher levels gain little and take several times as long."""


def h5py() -> Any:
    """Return the module h5py, or raise `ConfigError`, whose message says how to install h5py."""
    try:
        return importlib.import_module("h5py")
    except ImportError:
        raise ConfigError("data sets need h5py; install it with: pip install 'hybridmpm[data]'") from None


@contextmanager
def reading(path: Path) -> Iterator[Any]:
    """Open a file to read; raises `DataError` with its name where it is missing, damaged or no HDF5 file."""
    module = h5py()
    if not path.is_file():
        raise DataError(f"{path} does not exist")
    try:
        file = module.File(path, "r")
    except OSError as error:
        raise DataError(f"{path} is no HDF5 file, or damaged or cut off: {error}") from None
    with file:
        yield file


@contextmanager
def writing(path: Path) -> Iterator[Any]:
    """Create a file to write; where writing or closing fails, raises OSError with the system's reason."""
    try:
        with h5py().File(path, "w") as file:
            yield file
    except (OSError, RuntimeError) as error:
        number = re.search(r"errno = (\d+)", str(error))
        if number is None and isinstance(error, RuntimeError):
            # Where HDF5 could not flush a file, h5py raises RuntimeError.
            raise OSError(f"HDF5 could not write it: {error}") from error
        if number is None:
            raise
        raise OSError(int(number[1]), os.strerror(int(number[1]))) from error


def read_array(file: Any, key: str, path: Path) -> npt.NDArray[Any]:
    """Read an array of numbers; where it is missing or damaged, raises `DataError` with file and key."""
    found = file.get(key)
    if not isinstance(found, h5py().Dataset):
        there = ", ".join(list(file)[:8]) or "nothing"
        raise DataError(f"{path}: the key {key} is missing; the file holds {there}")
    if found.dtype.kind not in "iuf":
        raise DataError(f"{path}: {key} must hold numbers, got {found.dtype}")
    try:
        return np.asarray(found[()])
    except (OSError, RuntimeError) as error:
        raise DataError(f"{path}: {key} is damaged: {error}") from None


def read_text(file: Any, key: str, path: Path) -> str | None:
    """Read a string, None where the key is missing; where it is damaged, raises `DataError` with the key."""
    if key not in file:
        return None
    try:
        return str(file[key].asstr()[()])
    except (OSError, RuntimeError, TypeError, AttributeError) as error:
        raise DataError(f"{path}: {key} is damaged or no text: {error}") from None


def write_array(group: Any, key: str, array: npt.NDArray[Any]) -> None:
    """Write an array; an array (F, N, D) is compressed in chunks of several frames."""
    if array.ndim < 3 or array.size == 0:
        group.create_dataset(key, data=array)
        return
    frames = max(1, min(len(array), _CHUNK_BYTES // (array.itemsize * array[0].size)))
    made = group.create_dataset(
        key,
        shape=array.shape,
        dtype=array.dtype,
        chunks=(frames, *array.shape[1:]),
        compression="gzip",
        compression_opts=_LEVEL,
        shuffle=True,
    )
    # While zlib compresses, other threads run; HDF5's own compression would keep h5py's only lock.
    for start in range(0, len(array), frames):
        chunk = array[start : start + frames]
        missing = np.zeros((frames - len(chunk), *array.shape[1:]), array.dtype)
        made.id.write_direct_chunk((start, 0, 0), _filtered(np.concatenate([chunk, missing])))


def _filtered(chunk: npt.NDArray[Any]) -> bytes:
    """Shuffle and compress as HDF5's filters shuffle and gzip do: all first bytes, then all second ones."""
    by_byte = chunk.view(np.uint8).reshape(-1, chunk.itemsize).T
    return zlib.compress(by_byte.tobytes(), _LEVEL)


def write_trajectory(group: Any, trajectory: Trajectory, types: npt.NDArray[np.int64]) -> None:
    """Fill a group in LagrangeBench's layout, with force, mass, scene, seed and digest added.

    `types` (N,) are the particle types in the convention of the file. The digest is that of the trajectory,
    whose types are in DeepMind's convention.
    """
    write_array(group, "position", trajectory.positions)
    write_array(group, "particle_type", types)
    if trajectory.force is not None:
        write_array(group, "force", trajectory.force)
    if trajectory.mass is not None:
        write_array(group, "mass", trajectory.mass)
    if trajectory.scene is not None:
        group["scene"] = trajectory.scene.model_dump_json(exclude_none=True)
    if trajectory.seed is not None:
        group.attrs["seed"] = trajectory.seed
    if trajectory.control is not None:
        _write_control(group, trajectory.control)
    group.attrs["digest"] = trajectory.digest


def read_trajectory(file: Any, group: str, path: Path, types: npt.NDArray[np.int64]) -> Trajectory:
    """Read a group that `write_trajectory` filled; `types` (N,) are its types in DeepMind's convention.

    Raises
    ------
    DataError
        A key is missing or damaged, shapes disagree, or the data do not match their digest.
    """

    def optional(key: str) -> npt.NDArray[np.float32] | None:
        name = f"{group}/{key}"
        return read_array(file, name, path).astype(np.float32) if name in file else None

    scene = read_text(file, f"{group}/scene", path)
    attributes = file[group].attrs
    trajectory = Trajectory(
        positions=read_array(file, f"{group}/position", path).astype(np.float32, copy=False),
        types=types,
        force=optional("force"),
        mass=optional("mass"),
        seed=int(attributes["seed"]) if "seed" in attributes else None,
        scene=None if scene is None else Scene.from_json(scene),
        control=_read_control(file, group, path) if f"{group}/sketch" in file else None,
        place=Place(str(path)).under(group),
    )
    if "digest" in attributes and attributes["digest"] != trajectory.digest:
        raise DataError(f"{path}: {group} is damaged: its data do not match its digest")
    return trajectory


def _write_control(group: Any, control: Control) -> None:
    for key, array in control.arrays.items():
        write_array(group, key, array)
    for key, text in control.texts.items():
        group[key] = text
    write_array(group, "picture", np.frombuffer(control.picture, dtype=np.uint8))
    group.attrs.update(control.attributes)


def _read_control(file: Any, group: str, path: Path) -> Control:
    """Read what `_write_control` wrote; where a key is missing or damaged, raises `DataError`."""
    arrays = {
        key: read_array(file, f"{group}/{key}", path).astype(np.float32, copy=False)
        for key in ("velocity", "target", "smoothed_force")
    }
    texts = {key: read_text(file, f"{group}/{key}", path) or "" for key in ("sketch", "stroke")}
    picture = read_array(file, f"{group}/picture", path).astype(np.uint8, copy=False).tobytes()
    try:
        return Control.read(texts, dict(file[group].attrs), arrays, picture)
    except KeyError as error:
        raise DataError(f"{path}: the attribute {error} of {group} is missing") from None
    except (ValueError, SketchError) as error:
        raise DataError(f"{path}: {group} has a damaged sketch: {error}") from None


def file_bytes(trajectory: Trajectory, group: str) -> bytes:
    """Return an HDF5 file as bytes, with the trajectory as its only group."""
    memory = io.BytesIO()
    with h5py().File(memory, "w") as file:
        write_trajectory(file.create_group(group), trajectory, trajectory.types)
    return memory.getvalue()

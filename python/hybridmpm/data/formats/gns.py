"""npz files of geoelements/gns: each trajectory is a pair (positions, particle types) in an object array.

An object array is a pickle. `inert` reads it without running anything that it names.
"""

import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from hybridmpm._support.files import replacing
from hybridmpm.data.formats import inert
from hybridmpm.data.formats.layout import Format, chosen, files_as_splits
from hybridmpm.data.trajectory import Place, Trajectory
from hybridmpm.errors import DataError
from hybridmpm.scene.particle_types import UNCHANGED, translated

_ALL = "gns_data"
"""Key of the only array in files that have all trajectories in one array."""


def _file(folder: Path, split: str) -> Path:
    return folder / f"{split}.npz"


def _open(path: Path) -> zipfile.ZipFile:
    if not path.is_file():
        raise DataError(f"{path} does not exist")
    try:
        return zipfile.ZipFile(path)
    except (OSError, zipfile.BadZipFile) as error:
        raise DataError(f"{path} is no npz file, or damaged or cut off: {error}") from None


def _keys(archive: zipfile.ZipFile) -> list[str]:
    return [name.removesuffix(".npy") for name in archive.namelist()]


def _count(folder: Path, split: str) -> int:
    path = _file(folder, split)
    with _open(path) as archive:
        keys = _keys(archive)
        return len(_entry(archive, _ALL, path)) if keys == [_ALL] else len(keys)


def _read(folder: Path, split: str, numbers: Iterable[int] | None) -> Iterator[Trajectory]:
    path = _file(folder, split)
    with _open(path) as archive:
        keys = _keys(archive)
        together = _entry(archive, _ALL, path) if keys == [_ALL] else None
        for number in chosen(numbers, len(keys if together is None else together), path):
            if together is not None:
                yield _trajectory(together[number], f"{_ALL}[{number}]", path)
            else:
                yield _trajectory(_entry(archive, keys[number], path), keys[number], path)


def _entry(archive: zipfile.ZipFile, key: str, path: Path) -> Any:
    try:
        with archive.open(f"{key}.npy") as file:
            return _content(file)
    except inert.InertPickleError as error:
        raise DataError(
            f"{path}: {key} holds {error}; only arrays of numbers are read, the rest of a pickle could run "
            "any program. If you trust the file, write its positions and types to a new one with numpy"
        ) from None
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, NotImplementedError) as error:
        raise DataError(f"{path}: {key} is damaged: {error}") from None


def _content(file: IO[bytes]) -> Any:
    version = np.lib.format.read_magic(file)
    read_header = (
        np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    )
    shape, by_columns, dtype = read_header(file)
    if dtype.hasobject:
        return inert.load(file)
    if by_columns or dtype.kind not in "iuf":
        raise ValueError(f"an array of {dtype} where numbers in C order are expected")
    count = int(np.prod(np.array(shape, dtype=object)))
    return np.frombuffer(file.read(count * dtype.itemsize), dtype, count).reshape(shape)


def _trajectory(entry: Any, key: str, path: Path) -> Trajectory:
    if not isinstance(entry, list) or len(entry) < 2:
        raise DataError(f"{path}: {key} must be a pair of positions and particle types")
    where = f"{path}: the types of {key}"
    try:
        positions, types = np.asarray(entry[0], dtype=np.float32), _integers(entry[1], where)
    except (TypeError, ValueError) as error:
        raise DataError(f"{path}: {key} must hold arrays of numbers: {error}") from None
    if types.ndim == 0 and positions.ndim == 3:
        types = np.full(positions.shape[1], types)  # one type for all
    return Trajectory(
        positions=positions,
        types=translated(types, UNCHANGED, where=where),
        place=Place(str(path), position=f"{key}, positions,", types=f"{key}, types,"),
    )


def _integers(value: Any, where: str) -> npt.NDArray[np.int64]:
    types = np.asarray(value)
    whole = types.astype(np.int64)
    if not np.array_equal(whole, types):
        raise DataError(f"{where} must be whole numbers")
    return whole


def _write(folder: Path, split: str, trajectories: Iterable[Trajectory]) -> None:
    path = _file(folder, split)
    with replacing(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, trajectory in enumerate(trajectories):
            pair = np.empty(2, dtype=object)
            pair[0], pair[1] = trajectory.positions, trajectory.types
            with archive.open(f"simulation_trajectory_{number}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, pair, allow_pickle=True)


GNS = Format(
    name="gns",
    text="npz of geoelements/gns: {train,valid,test}.npz",
    splits=files_as_splits(".npz"),
    count=_count,
    read=_read,
    write=_write,
    keeps=frozenset(),
)

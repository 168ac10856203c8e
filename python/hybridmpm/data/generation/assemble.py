"""From shards to one HDF5 file for each split."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from hybridmpm._support.files import replacing
from hybridmpm.data import hdf5
from hybridmpm.data.generation.executors import GROUP
from hybridmpm.data.generation.shards import Shards
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import DataError
from hybridmpm.scene.particle_types import UNCHANGED, translated


def split_file(folder: Path, split: str) -> Path:
    """Return where a split lies."""
    return folder / f"{split}.h5"


def seeds_in(folder: Path, split: str) -> dict[int, str]:
    """Group of each seed in an assembled split, empty where there is none; raises `DataError`."""
    path = split_file(folder, split)
    if not path.exists():
        return {}
    with hdf5.reading(path) as file:
        try:
            return {int(file[group].attrs["seed"]): group for group in sorted(file)}
        except (KeyError, OSError, RuntimeError) as error:
            raise DataError(
                f"{path} is damaged or not of a generated data set: {error}; remove it to make it anew"
            ) from None


def assemble(folder: Path, split: str, shards: Shards, seeds: Sequence[int]) -> None:
    """Add the shards of `seeds` to a split, ordered by seed, and remove them.

    Data are copied as they are, compressed. The file appears under its name once it is complete.

    Raises
    ------
    ExportError
        The file cannot be written; shards and older file stay.
    DataError
        A shard or the older file cannot be read.
    """
    there = seeds_in(folder, split)
    new = [seed for seed in seeds if seed not in there]
    if new:
        path = split_file(folder, split)
        with replacing(path) as part, hdf5.writing(part) as target:
            for number, seed in enumerate(sorted([*there, *new])):
                old = seed in there
                with hdf5.reading(path if old else shards.path(seed)) as source:
                    source.copy(there[seed] if old else GROUP, target, name=f"{number:05d}")
    shards.drop(list(seeds))


def read_split(folder: Path, split: str) -> Iterator[Trajectory]:
    """Yield the trajectories of an assembled split, each against its digest; raises `DataError`."""
    path = split_file(folder, split)
    with hdf5.reading(path) as file:
        for group in sorted(file):
            key = f"{group}/particle_type"
            types = translated(hdf5.read_array(file, key, path), UNCHANGED, where=f"{path}: {key}")
            yield hdf5.read_trajectory(file, group, path, types)

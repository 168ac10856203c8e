"""Assembling the shards of a run into one HDF5 file for each split."""

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
    """Return the path of a split's file."""
    return folder / f"{split}.h5"


def seeds_in(folder: Path, split: str) -> dict[int, str]:
    """Return the group of each seed in an assembled split, none where there is no file.

    Raises
    ------
    DataError
        The file is damaged, or was not made by `generate`.
    """
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
    """Add the shards of `seeds` to the file of a split, ordered by seed, and remove the shards.

    Compressed data are copied as they are. The new file replaces the old one once it is complete.

    Raises
    ------
    ExportError
        The file cannot be written; the shards and the old file stay.
    DataError
        A shard or the old file cannot be read.
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
    shards.remove(list(seeds))


def read_split(folder: Path, split: str) -> Iterator[Trajectory]:
    """Yield the trajectories of an assembled split; raises `DataError` where a digest does not match."""
    path = split_file(folder, split)
    with hdf5.reading(path) as file:
        for group in sorted(file):
            key = f"{group}/particle_type"
            types = translated(hdf5.read_array(file, key, path), UNCHANGED, where=f"{path}: {key}")
            yield hdf5.read_trajectory(file, group, path, types)

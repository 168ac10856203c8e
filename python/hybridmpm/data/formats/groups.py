"""LagrangeBench's layout: an HDF5 file for each split, in it a group for each trajectory.

A group has `position` and `particle_type`. The types are numbered in one of two ways: in DeepMind's way, as
we write them and as LagrangeBench's own converter of DeepMind's data leaves them, or in LagrangeBench's way.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from hybridmpm._support.files import replacing
from hybridmpm.data import hdf5
from hybridmpm.data.formats.layout import Format, chosen, files_as_splits
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.scene.particle_types import FROM_LAGRANGEBENCH, TO_LAGRANGEBENCH, UNCHANGED, translated


def _file(folder: Path, split: str) -> Path:
    return folder / f"{split}.h5"


def _count(folder: Path, split: str) -> int:
    with hdf5.reading(_file(folder, split)) as file:
        return len(file)


def _format(name: str, text: str, incoming: Mapping[int, int], outgoing: Mapping[int, int]) -> Format:
    def read(folder: Path, split: str, numbers: Iterable[int] | None) -> Iterator[Trajectory]:
        path = _file(folder, split)
        with hdf5.reading(path) as file:
            groups = sorted(file)
            for number in chosen(numbers, len(groups), path):
                key = f"{groups[number]}/particle_type"
                types = translated(hdf5.read_array(file, key, path), incoming, where=f"{path}: {key}")
                yield hdf5.read_trajectory(file, groups[number], path, types)

    def write(folder: Path, split: str, trajectories: Iterable[Trajectory]) -> None:
        path = _file(folder, split)
        with replacing(path) as part, hdf5.writing(part) as file:
            for number, trajectory in enumerate(trajectories):
                types = translated(trajectory.types, outgoing, where=trajectory.place.file)
                hdf5.write_trajectory(file.create_group(f"{number:05d}"), trajectory, types)

    return Format(
        name=name,
        text=text,
        splits=files_as_splits(".h5"),
        count=_count,
        read=read,
        write=write,
        keeps=frozenset({"force", "mass", "scene", "control"}),
    )


HYBRIDMPM = _format(
    "hybridmpm", "LagrangeBench's layout with DeepMind's types: {train,valid,test}.h5", UNCHANGED, UNCHANGED
)
LAGRANGEBENCH = _format(
    "lagrangebench",
    "LagrangeBench's layout and types: {train,valid,test}.h5",
    FROM_LAGRANGEBENCH,
    TO_LAGRANGEBENCH,
)

"""`Format`: how a data set lies in a folder, and how its trajectories are read and written."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import DataError

Write = Callable[[Path, str, Iterable[Trajectory]], None]


@dataclass(frozen=True, kw_only=True)
class Format:
    """One way to store a data set in a folder. Trajectories read or to be written have DeepMind's types."""

    name: str
    text: str
    """Files of the format, for people."""
    splits: Callable[[Path], list[str]]
    """Return the splits that a folder has in this format."""
    count: Callable[[Path, str], int]
    """Return the number of trajectories of a split, without reading all of them."""
    read: Callable[[Path, str, Iterable[int] | None], Iterator[Trajectory]]
    """Yield the trajectories of a split that have given numbers, all if None; raises `DataError`."""
    write: Write | None
    """Write a split whole or not at all; raises `ExportError`. None if the format can only be read."""
    keeps: frozenset[str]
    """Columns besides positions and types: some of "force", "mass", "scene" and "control"."""


def files_as_splits(suffix: str) -> Callable[[Path], list[str]]:
    """Return the function `Format.splits` of a format with one file for each split."""

    def splits(folder: Path) -> list[str]:
        found = {path.stem for path in folder.glob(f"*{suffix}") if not path.name.startswith(".")}
        return in_order(found)

    return splits


def in_order(found: Iterable[str]) -> list[str]:
    """Return splits in order: "train", "valid" and "test" first, then the others by name."""
    usual = ["train", "valid", "test"]
    return sorted(found, key=lambda name: (usual.index(name) if name in usual else len(usual), name))


def chosen(numbers: Iterable[int] | None, count: int, where: Path) -> list[int]:
    """Return `numbers`, or all below `count` if None; raises `DataError` where one is out of range."""
    wanted = list(range(count)) if numbers is None else list(numbers)
    beyond = [number for number in wanted if not 0 <= number < count]
    if beyond:
        raise DataError(f"{where} holds the trajectories 0 to {count - 1}, not {beyond[0]}")
    return wanted

"""What a format is: where its splits lie, and how trajectories come out of them and go in."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import DataError

Write = Callable[[Path, str, Iterable[Trajectory]], None]


@dataclass(frozen=True, kw_only=True)
class Format:
    """One way to keep a data set in a folder. Trajectories have DeepMind's types on both sides."""

    name: str
    text: str
    splits: Callable[[Path], list[str]]
    """Splits that a folder holds in this format."""
    count: Callable[[Path, str], int]
    """Trajectories of a split, without reading them all."""
    read: Callable[[Path, str, Iterable[int] | None], Iterator[Trajectory]]
    """Yield the trajectories of a split, those of some numbers or all; raises `DataError`."""
    write: Write | None
    """Write a split whole or not at all; raises `ExportError`. None where a format is only read."""
    keeps: frozenset[str]
    """What it can hold besides positions and types: of "force", "mass" and "scene"."""


def files_as_splits(suffix: str) -> Callable[[Path], list[str]]:
    """Return a `splits` for formats with one file a split."""

    def splits(folder: Path) -> list[str]:
        found = {path.stem for path in folder.glob(f"*{suffix}") if not path.name.startswith(".")}
        return in_order(found)

    return splits


def in_order(found: Iterable[str]) -> list[str]:
    """Sort splits: those for training, validation and testing first."""
    usual = ["train", "valid", "test"]
    return sorted(found, key=lambda name: (usual.index(name) if name in usual else len(usual), name))


def chosen(numbers: Iterable[int] | None, count: int, where: Path) -> list[int]:
    """Return `numbers`, all if None; raises `DataError` where one is out of range."""
    wanted = list(range(count)) if numbers is None else list(numbers)
    beyond = [number for number in wanted if not 0 <= number < count]
    if beyond:
        raise DataError(f"{where} holds the trajectories 0 to {count - 1}, not {beyond[0]}")
    return wanted

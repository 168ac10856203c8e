"""Training data by seed: a file for each scene that a seed draws, made where it is missing."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm._support.files import replacing
from hybridmpm._support.machine import usable_cores
from hybridmpm.errors import DataError, SimulationError, SketchError
from hybridmpm.scene import Scene
from hybridmpm.training.sources import Drawn

Columns: TypeAlias = Mapping[str, npt.NDArray[Any]]


def prepare(
    root: Path,
    source: Drawn,
    seeds: Sequence[int],
    make: Callable[[Scene, int], Columns],
    on_progress: Callable[[int], object] = lambda _count: None,
) -> None:
    """Make the missing files of a source; an interrupted call can be repeated.

    Parameters
    ----------
    root : Path
        Folder with a folder for each source.
    source : Drawn
    seeds : sequence of int
    make : callable
        Returns the columns of a scene and its seed. Where it raises SimulationError or SketchError, the file
        stays empty.
    on_progress : callable
        Called with the number of files done since its last call.

    Raises
    ------
    ExportError
        A file cannot be written.
    """
    folder = root / source.folder
    folder.mkdir(parents=True, exist_ok=True)

    def one(seed: int) -> None:
        try:
            columns = make(source.scene(seed), seed)
        except (SimulationError, SketchError):
            columns = {}
        with replacing(_file(folder, seed)) as part:
            np.savez(part, **columns)  # type: ignore[arg-type]

    todo = [seed for seed in seeds if not _file(folder, seed).exists()]
    with ThreadPoolExecutor(usable_cores()) as pool:
        try:
            for _ in pool.map(one, todo):
                on_progress(1)
        finally:
            pool.shutdown(cancel_futures=True)  # after a signal, no other scene begins


def missing(root: Path, source: Drawn, seeds: Sequence[int]) -> int:
    """Return the number of files that `prepare` would make."""
    return sum(not _file(root / source.folder, seed).exists() for seed in seeds)


def read(
    root: Path, source: Drawn, seeds: Sequence[int], names: Sequence[str]
) -> list[tuple[int, dict[str, npt.NDArray[Any]]]]:
    """Return seeds and columns of some files, without the empty ones.

    Raises
    ------
    DataError
        A file is damaged, or there is none at all.
    """
    found = [(seed, _read(_file(root / source.folder, seed), names)) for seed in seeds]
    filled = [(seed, columns) for seed, columns in found if columns is not None]
    if not filled:
        raise DataError(
            f"no simulation of the {len(seeds)} scenes in {root / source.folder} succeeded, or fluid "
            "hardly moves in them: look at one by hybridmpm simulate, and delete the folder"
        )
    return filled


def _file(folder: Path, seed: int) -> Path:
    return folder / f"{seed:07d}.npz"


def _read(path: Path, names: Sequence[str]) -> dict[str, npt.NDArray[Any]] | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in names} if file.files else None
    except (OSError, ValueError, KeyError) as error:
        raise DataError(f"{path} is damaged ({error}): delete it, and it is made anew") from None

"""Shards: one file for each finished trajectory, until its split is assembled.

A killed process leaves a damaged HDF5 file, so each shard is written under another name and then renamed.
"""

import contextlib
import fcntl
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hybridmpm._support.files import replacing
from hybridmpm.data import hdf5
from hybridmpm.data.generation.executors import GROUP
from hybridmpm.data.recipe import Recipe
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import ConfigError, DataError, ExportError
from hybridmpm.scene.particle_types import UNCHANGED, translated

FOLDER = "shards"
METADATA = "metadata.json"


class Shards:
    """The shards of a data set, in a folder that is made where it is missing.

    Raises
    ------
    ExportError
        The folder cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder / FOLDER
        self._metadata = folder / METADATA
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ExportError(f"cannot write {self.folder}: {error.strerror or error}") from error

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the data set against other processes; the system frees the lock when this process ends.

        Raises
        ------
        ConfigError
            Another process is writing this data set.
        """
        handle = os.open(self.folder, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            text = "another process is writing this data set; wait for it or choose another folder"
            raise ConfigError(f"{self.folder.parent}: {text}") from None
        else:
            yield
        finally:
            os.close(handle)

    def claim(self, recipe: Recipe) -> None:
        """Note `recipe` in an empty folder, or check that the folder's data were made with it.

        Raises
        ------
        ConfigError
            The folder has data of another recipe; the message names the settings that differ.
        """
        wanted = json.loads(json.dumps(recipe.to_dict()))
        note = self.folder / "recipe.json"
        there = _json(note) if note.exists() else None
        if there is None and self._metadata.exists():
            there = _json(self._metadata).get("hybridmpm", {}).get("recipe", {})
        if there is None:
            with replacing(note) as part:
                part.write_text(json.dumps(wanted) + "\n", encoding="utf-8")
            return
        # The first solver's data do not name it, and the first data sets were none of control.
        there = {"solver_version": 1, "control": False} | there
        differing = [key for key in wanted if there.get(key) != wanted[key]]
        if differing:
            pairs = ", ".join(f"{key} = {there.get(key)!r}, not {wanted[key]!r}" for key in differing[:3])
            raise ConfigError(f"{self.folder.parent} holds data made with {pairs}; choose another folder")

    def path(self, seed: int) -> Path:
        """Return the path of a seed's shard."""
        return self.folder / f"{seed:07d}.h5"

    def store(self, seed: int, shard: bytes) -> None:
        """Write a finished trajectory; where that fails, raises `ExportError`, and other shards stay."""
        with replacing(self.path(seed)) as part:
            part.write_bytes(shard)

    def is_intact(self, seed: int) -> bool:
        """Whether a seed has a shard; raises `DataError` where the shard is damaged."""
        if not self.path(seed).exists():
            return False
        self.read(seed)
        return True

    def read(self, seed: int) -> Trajectory:
        """Read a seed's trajectory; where it is damaged, raises `DataError` with file and key."""
        path = self.path(seed)
        with hdf5.reading(path) as file:
            key = f"{GROUP}/particle_type"
            types = translated(hdf5.read_array(file, key, path), UNCHANGED, where=f"{path}: {key}")
            trajectory = hdf5.read_trajectory(file, GROUP, path, types)
        if trajectory.seed != seed:
            raise DataError(f"{path}: {GROUP} is of seed {trajectory.seed}, not of {seed}")
        return trajectory

    def remove_unfinished(self) -> None:
        """Remove the unfinished files of killed processes."""
        for part in self.folder.glob(".*"):
            part.unlink(missing_ok=True)

    def remove(self, seeds: Iterable[int]) -> None:
        """Remove the shards of seeds, where there are any."""
        for seed in seeds:
            self.path(seed).unlink(missing_ok=True)

    def finish(self) -> None:
        """Remove the folder of the shards, unless shards that belong to no split remain in it."""
        (self.folder / "recipe.json").unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            self.folder.rmdir()


def _json(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(f"{path} is damaged: {error}") from None
    if not isinstance(found, dict):
        raise DataError(f"{path} must hold a JSON object")
    return found

"""Data sets that a network is trained on: made from their seeds where missing, checked where they exist."""

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm import data
from hybridmpm.data import metadata
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.training.sources import DataSet, Drawn, Source


@dataclass(frozen=True, kw_only=True)
class Amount:
    """Number and length of the trajectories of each source that draws its scenes."""

    train: int = 200
    """Number of trajectories for training."""
    valid: int = 4
    """Number of trajectories for validation."""
    frames: int = 400
    """Number of frames of a trajectory, rounded down to a multiple of r_t."""


def folder_of(root: Path, source: Source, spec: NetworkSpec) -> Path:
    """Return the folder of a source's data set at the network's r_p and r_t."""
    if isinstance(source, DataSet):
        return source.folder
    return root / f"{source.folder}-rp{spec.r_p:.4g}-rt{spec.r_t}"


def missing(root: Path, source: Drawn, spec: NetworkSpec, amount: Amount) -> int:
    """Return the number of trajectories that `prepare` would make; raises what `hybridmpm.data.plan` does."""
    return len(_planned(root, source, spec, amount).todo)


def prepare(
    root: Path,
    source: Drawn,
    spec: NetworkSpec,
    amount: Amount,
    on_progress: Callable[[int], object] = lambda _count: None,
) -> None:
    """Make the missing trajectories of a network's data set; an interrupted call can be repeated.

    Parameters
    ----------
    root : Path
        Folder with a data set for each source.
    source : Drawn
    spec : NetworkSpec
    amount : Amount
    on_progress : callable
        Called with the number of trajectories done since its last call.

    Raises
    ------
    ConfigError, DataError, ExportError
        For the reasons of `hybridmpm.data.plan` and `hybridmpm.data.generate`.
    """
    planned = _planned(root, source, spec, amount)
    if planned.todo or not (planned.folder / metadata.FILE).exists():
        data.generate(planned, executor=data.Threads(), on_progress=on_progress)


def _planned(root: Path, source: Drawn, spec: NetworkSpec, amount: Amount) -> data.Plan:
    folder = folder_of(root, source, spec)
    folder.mkdir(parents=True, exist_ok=True)
    frames = amount.frames // spec.r_t * spec.r_t
    recipe = source.recipe(frames=frames, stride=spec.r_t, r_p=spec.r_p)
    return data.plan(recipe, folder, data.Seeds(train=amount.train, valid=amount.valid))


def trajectories(root: Path, source: Source, spec: NetworkSpec, split: str) -> Iterator[data.Trajectory]:
    """Yield the trajectories of a split of a source, with a state every `r_t` frames.

    Raises
    ------
    DataError
        A data set is damaged, or `check` refuses it.
    """
    folder = folder_of(root, source, spec)
    every = check(folder, spec)
    for trajectory in DataSet(folder).read(split):
        yield _thinned(trajectory, every)


def ratio_and_stride(source: DataSet) -> tuple[float, int]:
    """Return r_p and the number of frames from one state to the next of a data set; raises `DataError`."""
    ours = metadata.read(source.folder).get("hybridmpm", {})
    return float(ours.get("r_p", 1.0)), int(ours.get("frame_stride", 1))


def check(folder: Path, spec: NetworkSpec) -> int:
    """Refuse a data set that the network cannot be trained on; return in how many states one is used.

    Raises
    ------
    DataError
        Its time step, dimension, r_p or bounds are not the network's; the message names both values.
    """
    about = metadata.read(folder)
    ours = about.get("hybridmpm", {})
    every: int = max(1, round(spec.step_dt / about["dt"]))
    wanted: dict[str, tuple[Any, Any]] = {
        "dt": (about["dt"] * every, spec.step_dt),
        "dim": (about["dim"], spec.dim),
        "r_p": (ours.get("r_p", 1.0), spec.r_p),
        "bounds": (about["bounds"], spec.bounds),
    }
    for name, (there, needed) in wanted.items():
        if np.shape(there) != np.shape(needed) or not np.allclose(there, needed, rtol=1e-6):
            shown = about["dt"] if name == "dt" else there
            raise DataError(
                f"{folder}: {name} is {shown}, but the network is for {needed}; use a data set made for it"
            )
    return every


def _thinned(trajectory: data.Trajectory, every: int) -> data.Trajectory:
    if every == 1:
        return trajectory
    if trajectory.force is not None:
        raise ConfigError(
            f"{trajectory.place.file} stores a force for each frame, which does not fit steps of several: "
            "give --r-t 1"
        )
    return dataclasses.replace(trajectory, positions=trajectory.positions[::every].copy())

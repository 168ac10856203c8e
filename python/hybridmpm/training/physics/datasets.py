"""Data sets that a network is trained on: made from their seeds where missing, checked where they exist."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm import data
from hybridmpm.data import metadata
from hybridmpm.data.generation.assemble import read_split
from hybridmpm.errors import DataError
from hybridmpm.physics.spec import NetworkSpec


@dataclass(frozen=True, kw_only=True)
class Amount:
    """Number and length of the trajectories of each scenario."""

    train: int = 200
    """Number of trajectories for training."""
    valid: int = 4
    """Number of trajectories for validation."""
    frames: int = 400
    """Number of frames of a trajectory, rounded down to a multiple of r_t."""


def folder_of(root: Path, scenario: str, spec: NetworkSpec) -> Path:
    """Return the folder of a scenario's data set at the network's r_p and r_t."""
    return root / f"{scenario}-rp{spec.r_p:.4g}-rt{spec.r_t}"


def missing(root: Path, spec: NetworkSpec, amount: Amount) -> int:
    """Return the number of trajectories that `prepare` would make; raises what `hybridmpm.data.plan` does."""
    return sum(len(_planned(root, scenario, spec, amount).todo) for scenario in spec.scenarios)


def prepare(
    root: Path, spec: NetworkSpec, amount: Amount, on_progress: Callable[[int], object] = lambda _count: None
) -> None:
    """Make the missing trajectories of a network's data sets; an interrupted call can be repeated.

    Parameters
    ----------
    root : Path
        Folder with a data set for each scenario.
    spec : NetworkSpec
    amount : Amount
    on_progress : callable
        Called with the number of trajectories done since its last call.

    Raises
    ------
    ConfigError, DataError, ExportError
        For the reasons of `hybridmpm.data.plan` and `hybridmpm.data.generate`.
    """
    for scenario in spec.scenarios:
        planned = _planned(root, scenario, spec, amount)
        if planned.todo or not (planned.folder / metadata.FILE).exists():
            data.generate(planned, executor=data.Threads(), on_progress=on_progress)


def _planned(root: Path, scenario: str, spec: NetworkSpec, amount: Amount) -> data.Plan:
    folder = folder_of(root, scenario, spec)
    folder.mkdir(parents=True, exist_ok=True)
    frames = amount.frames // spec.r_t * spec.r_t
    recipe = data.Recipe(scenario=scenario, frames=frames, stride=spec.r_t, r_p=spec.r_p)
    return data.plan(recipe, folder, data.Seeds(train=amount.train, valid=amount.valid))


def trajectories(root: Path, spec: NetworkSpec, split: str) -> list[data.Trajectory]:
    """Return the trajectories of a split of all scenarios.

    Raises
    ------
    DataError
        A data set is damaged, or `check` refuses it.
    """
    found: list[data.Trajectory] = []
    for scenario in spec.scenarios:
        folder = folder_of(root, scenario, spec)
        check(folder, spec)
        found += read_split(folder, split)
    return found


def check(folder: Path, spec: NetworkSpec) -> None:
    """Refuse a data set that the network cannot be trained on.

    Raises
    ------
    DataError
        Its time step, dimension, r_p or bounds are not the network's; the message names both values.
    """
    about = metadata.read(folder)
    ours = about.get("hybridmpm", {})
    wanted: dict[str, tuple[Any, Any]] = {
        "dt": (about["dt"], spec.step_dt),
        "dim": (about["dim"], spec.dim),
        "r_p": (ours.get("r_p", 1.0), spec.r_p),
        "bounds": (about["bounds"], spec.bounds),
    }
    for name, (there, needed) in wanted.items():
        if not np.allclose(there, needed, rtol=1e-6):
            raise DataError(
                f"{folder}: {name} is {there}, but the network is for {needed}; use a data set made for it"
            )


def held_out(root: Path, spec: NetworkSpec) -> Iterator[data.Trajectory]:
    """Yield the first validation trajectory of each scenario."""
    for scenario in spec.scenarios:
        yield next(read_split(folder_of(root, scenario, spec), "valid"))

"""Making a data set in parallel; a run can be interrupted and resumed at any time."""

import shutil
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from hybridmpm.coarse.merging import spacing_at
from hybridmpm.data import metadata, splits
from hybridmpm.data.generation import assemble
from hybridmpm.data.generation.executors import Executor
from hybridmpm.data.generation.shards import Shards
from hybridmpm.data.recipe import Recipe
from hybridmpm.data.splits import Seeds
from hybridmpm.data.statistics import Statistics
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.scene.kinematic import kinematic_particles

if TYPE_CHECKING:
    from hybridmpm.scene import Scene

_SAMPLED = 8
"""Number of scenes, about, from which the size of all trajectories is estimated."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a run."""

    recipe: Recipe
    folder: Path
    seeds: Seeds
    todo: tuple[int, ...]
    """Seeds that have no trajectory yet, those for training first."""
    done: int
    """Number of seeds that have a trajectory."""
    bytes_needed: int
    """Size of the missing trajectories before compression [bytes], estimated from some of their scenes."""
    bytes_between: int
    """Size of the missing trajectories together with the largest split, which is assembled beside its
    shards [bytes]."""
    bytes_free: int
    """Free room on the disk of the folder [bytes]."""
    damaged: tuple[str, ...]
    """Messages about damaged shards, whose seeds are in `todo`."""


@dataclass(kw_only=True)
class Report:
    """Result of a run."""

    made: int = 0
    """Number of new trajectories."""
    failed: dict[int, str] = field(default_factory=dict)
    """Messages of the simulations that failed, by seed. All other seeds are in the data set."""


def plan(recipe: Recipe, folder: Path, seeds: Seeds) -> Plan:
    """Find out which trajectories are missing. This makes the folder and removes nothing.

    Raises
    ------
    ConfigError
        The folder has data of another recipe, or the disk has not enough room.
    DataError
        An assembled split is damaged.
    ExportError
        The folder cannot be written.
    """
    shards = Shards(folder)
    shards.claim(recipe)
    todo, damaged = _missing(folder, shards, seeds)
    needed = _estimated_bytes(recipe, todo)
    largest = max(
        _estimated_bytes(recipe, [s for s in todo if splits.split_of(s) == name]) for name in splits.NAMES
    )
    found = Plan(
        recipe=recipe,
        folder=folder,
        seeds=seeds,
        todo=tuple(todo),
        done=len(seeds.all()) - len(todo),
        bytes_needed=needed,
        bytes_between=needed + largest,
        bytes_free=shutil.disk_usage(folder).free,
        damaged=tuple(damaged),
    )
    if found.bytes_between > found.bytes_free:
        raise ConfigError(
            f"{folder} needs up to {found.bytes_between / 1e9:.2f} GB while it is written, but its disk has "
            f"{found.bytes_free / 1e9:.2f} GB free; make fewer trajectories or free some room"
        )
    return found


def generate(
    planned: Plan, *, executor: Executor, on_progress: Callable[[int], object] = lambda _count: None
) -> Report:
    """Make the missing trajectories, and assemble splits and metadata.

    A trajectory depends on recipe and seed alone, so neither the executor nor interruptions change the data.
    If the run is stopped, finished trajectories stay, and calling `plan` and `generate` again makes the
    others. A simulation that fails is left out and named in the report and in `metadata.json`.

    Parameters
    ----------
    planned : Plan
        Result of `plan`.
    executor : Executor
        What makes the trajectories: `Threads` or `RayTasks`.
    on_progress : callable
        Called with the number of trajectories done since its last call.

    Raises
    ------
    ConfigError
        Another process is writing this data set, or all simulations failed.
    DataError
        An assembled split is damaged.
    ExportError
        A file cannot be written.
    """
    shards, report = Shards(planned.folder), Report()
    with shards.locked():
        shards.remove_unfinished()
        shards.remove(planned.todo)  # those that are damaged
        with closing(executor.run(planned.recipe, planned.todo)) as outcomes:
            for outcome in outcomes:
                if outcome.shard is None:
                    report.failed[outcome.seed] = outcome.failure or "unknown"
                else:
                    shards.store(outcome.seed, outcome.shard)
                    report.made += 1
                on_progress(1)
        if planned.todo or not (planned.folder / metadata.FILE).exists():
            _assemble(planned, shards)
            _describe(planned, report)
        shards.finish()
    return report


def _missing(folder: Path, shards: Shards, seeds: Seeds) -> tuple[list[int], list[str]]:
    todo: list[int] = []
    damaged: list[str] = []
    for split in splits.NAMES:
        there = assemble.seeds_in(folder, split)
        for seed in seeds.of(split):
            try:
                if seed in there or shards.is_intact(seed):
                    continue
            except DataError as error:
                damaged.append(str(error))
            todo.append(seed)
    return todo, damaged


def _estimated_bytes(recipe: Recipe, todo: Sequence[int]) -> int:
    """Return the size of trajectories before compression [bytes], estimated from some of their scenes."""
    if not todo:
        return 0
    sampled = todo[:: max(1, len(todo) // _SAMPLED)]
    arrays = 3 if recipe.control else 2 if recipe.force else 1
    total = 0
    for seed in sampled:
        scene = recipe.scene(seed)
        spacing = spacing_at(scene, recipe.r_p)
        fluid = sum(body.measure for body in scene.bodies) / spacing**scene.dim
        count = int(fluid) + len(kinematic_particles(scene, spacing))
        total += count * (4 * scene.dim * arrays * recipe.states + 12)
    return total * len(todo) // len(sampled)


def _assemble(planned: Plan, shards: Shards) -> None:
    for split in splits.NAMES:
        ready = [seed for seed in planned.seeds.of(split) if shards.path(seed).exists()]
        assemble.assemble(planned.folder, split, shards, ready)


def _describe(planned: Plan, report: Report) -> None:
    """Read all splits once more, checking each trajectory's digest, and write `metadata.json`."""
    scenes: list[Scene] = []
    statistics: dict[str, Statistics] = {}
    digests: dict[str, list[str]] = {}
    seeds: dict[str, list[int]] = {}
    for split in splits.NAMES:
        if not assemble.split_file(planned.folder, split).exists():
            continue
        statistics[split], digests[split], seeds[split] = Statistics(), [], []
        for trajectory in assemble.read_split(planned.folder, split):
            statistics[split].add(trajectory)
            digests[split].append(trajectory.digest)
            if trajectory.seed is not None and trajectory.scene is not None:
                seeds[split].append(trajectory.seed)
                scenes.append(trajectory.scene)
    if not scenes:
        failures = "; ".join(f"seed {seed}: {text}" for seed, text in list(report.failed.items())[:3])
        raise ConfigError(f"no trajectory could be made: {failures}")
    data = metadata.describe(
        planned.recipe, scenes, statistics, digests=digests, seeds=seeds, failed=report.failed
    )
    metadata.write(planned.folder, data)

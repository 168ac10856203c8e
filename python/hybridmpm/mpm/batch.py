"""`MpmBatch`: many scenes side by side, each on one thread."""

import copy
from collections.abc import Iterable, Iterator, Sequence
from typing import Self, overload

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import whole
from hybridmpm.errors import BatchError, ConfigError, SimulationError
from hybridmpm.force import CheckedForce, Force, checked_force
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.mpm.solver import MpmSolver, Substeps
from hybridmpm.scene import Scene
from hybridmpm.simulator import MAX_FRAMES_AT_ONCE


class MpmBatch(Sequence[MpmSolver]):
    """Solvers of independent scenes that advance in parallel; a sequence of `MpmSolver`.

    A member's result is that of a solver alone, to the bit, whatever the others do and however many threads
    there are. Members differ as they like in dimension, size and frame length, and may also be advanced,
    saved or restored alone: `batch[3].positions`.

    Parameters
    ----------
    scenes : sequence of Scene
    substeps, cfl, allow_unstable, sleep
        Of every member, as for `MpmSolver`.
    threads : int in [1, 1024], optional
        Scenes that advance at a time; as many as the process may use if absent.

    Raises
    ------
    SceneError
        A scene is no Scene, or cannot be filled with particles.
    ConfigError
        `scenes` is no list, or a setting is out of range.
    """

    def __init__(
        self,
        scenes: Sequence[Scene],
        *,
        substeps: Substeps = "cfl",
        cfl: float | None = None,
        allow_unstable: bool = False,
        sleep: Sleep | None = None,
        threads: int | None = None,
    ) -> None:
        if isinstance(scenes, Scene | str) or not isinstance(scenes, Iterable):
            raise ConfigError(
                f"scenes must be a list of scenes, got a {type(scenes).__name__}: write [scene]"
            )
        self._threads = None if threads is None else whole("threads", threads, 1, 1024)
        self._members = tuple(
            MpmSolver(scene, substeps=substeps, cfl=cfl, allow_unstable=allow_unstable, sleep=sleep)
            for scene in scenes
        )

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    def __repr__(self) -> str:
        count = sum(member.particle_count for member in self._members)
        return f"MpmBatch({len(self)} scenes, {count} particles)"

    def __len__(self) -> int:
        return len(self._members)

    @overload
    def __getitem__(self, index: int) -> MpmSolver: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[MpmSolver, ...]: ...
    def __getitem__(self, index: int | slice) -> MpmSolver | tuple[MpmSolver, ...]:
        return self._members[index]

    def __iter__(self) -> Iterator[MpmSolver]:
        return iter(self._members)

    def advance(self, frames: int = 1, force: Sequence[Force] | None = None) -> None:
        """Advance every member by whole frames.

        Parameters
        ----------
        frames : int in [0, 1000000]
        force : sequence with one entry for each member, optional
            Force on the member, in any form that its own `advance` takes, or None.

        Raises
        ------
        BatchError
            Frames of some members failed. Its message and its `failures` name them by index; each is in the
            state before its failed frame, and all others have advanced.
        ForceError
            An array among the forces has a wrong shape or is not finite; nothing has moved.
        ConfigError
            `frames` is out of range, or `force` has not one entry for each member; nothing has moved.
        """
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        if force is not None and not (isinstance(force, Sequence) and len(force) == len(self)):
            got = len(force) if isinstance(force, Sequence) else type(force).__name__
            raise ConfigError(f"force must be a list, one entry for each of {len(self)} scenes, got {got}")
        given = force if force is not None else [None] * len(self)
        checked = [
            checked_force(one, member, frames, f"force[{index}]")
            for index, (one, member) in enumerate(zip(given, self._members, strict=True))
        ]
        if any(one.by_frame for one in checked):
            failures = self._advance_by_frame(frames, checked)
        else:
            failures = self._advance_members(frames, dict(enumerate(one.array for one in checked)))
        _raise_failures(failures)
        for member in self._members:
            member._warn(stacklevel=3)  # noqa: SLF001 - as its own `advance` does

    def _advance_by_frame(self, frames: int, forces: Sequence[CheckedForce]) -> dict[int, SimulationError]:
        """Advance frame by frame, since some forces depend on the state; members that fail stay behind."""
        failures: dict[int, SimulationError] = {}
        for frame in range(frames):
            rows: dict[int, npt.NDArray[np.float32] | None] = {}
            for index in sorted(set(range(len(self))) - set(failures)):
                try:
                    rows[index] = forces[index].at(frame)
                except SimulationError as error:
                    failures[index] = error
            failures |= self._advance_members(1, rows)
        return failures

    def _advance_members(
        self, frames: int, forces: dict[int, npt.NDArray[np.float32] | None]
    ) -> dict[int, SimulationError]:
        """Advance the members that have an entry, side by side; return the errors of those that failed."""
        indices = list(forces)
        try:
            _core.advance_all(
                [self._members[index]._solver for index in indices],  # noqa: SLF001 - the core advances them
                frames,
                list(forces.values()),
                self._threads,
            )
        except BatchError as error:
            return {indices[place]: failure for place, failure in error.failures.items()}
        return {}


def _raise_failures(failures: dict[int, SimulationError]) -> None:
    if failures:
        ordered = dict(sorted(failures.items()))
        error = BatchError("; ".join(f"scene {index}: {failure}" for index, failure in ordered.items()))
        error.failures = ordered
        raise error

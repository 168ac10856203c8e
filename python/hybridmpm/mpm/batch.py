"""`MpmBatch`: many scenes side by side, each on one thread."""

from collections.abc import Iterator, Sequence
from typing import overload

import numpy.typing as npt

from hybridmpm import _native
from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.mpm.snapshots import Substeps
from hybridmpm.mpm.solver import MAX_FRAMES_AT_ONCE, MpmSolver, acceleration
from hybridmpm.scene import Scene


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
        A scene cannot be filled with particles.
    ConfigError
        A setting is out of range.
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
        self._threads = None if threads is None else whole("threads", threads, 1, 1024)
        self._members = tuple(
            MpmSolver(scene, substeps=substeps, cfl=cfl, allow_unstable=allow_unstable, sleep=sleep)
            for scene in scenes
        )

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

    def advance(self, frames: int = 1, force: Sequence[npt.ArrayLike | None] | None = None) -> None:
        """Advance every member by whole frames.

        Parameters
        ----------
        frames : int in [0, 1000000]
        force : one entry a member, optional
            What the member's own `advance` takes: (N, D) or (frames, N, D) [m/s^2], or None.

        Raises
        ------
        BatchError
            Frames of some members failed. Its message and its `failures` name them by index; each is in the
            state before its failed frame, and all others have advanced.
        ConfigError
            `frames` out of range or `force` of a wrong shape; nothing has moved.
        """
        if force is not None and len(force) != len(self):
            raise ConfigError(f"force must have one entry a scene, {len(self)}, got {len(force)}")
        held = force if force is not None else [None] * len(self)
        _native.advance_all(
            [member._solver for member in self._members],  # noqa: SLF001 - the core advances them together
            whole("frames", frames, 0, MAX_FRAMES_AT_ONCE),
            [acceleration(f"force[{index}]", one) for index, one in enumerate(held)],
            self._threads,
        )
        for member in self._members:
            member._tell_limit()  # noqa: SLF001 - as its own `advance` does

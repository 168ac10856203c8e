"""`Upsampler`: all particles of a scene, carried along by the few that somebody simulates."""

from collections.abc import Sequence
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.errors import SnapshotError
from hybridmpm.scene import Scene

_Floats = npt.NDArray[np.float32]


class Few(Protocol):
    """The few particles that carry the others, n of them, whoever simulates them."""

    @property
    def frame(self) -> int:
        """Number of frames since the start."""

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (n,) that they keep for good, ascending."""

    @property
    def positions(self) -> _Floats:
        """Positions (n, D) [m]."""

    @property
    def velocities(self) -> _Floats:
        """Velocities (n, D) [m/s]."""

    @property
    def affine(self) -> _Floats | None:
        """Velocity gradients (n, D, D) [1/s], as APIC's matrices; None where nobody knows them."""

    @property
    def mass(self) -> _Floats:
        """Masses (n,) [kg]."""


class Upsampler:
    """All N particles of a scene, moved along by few.

    At every `every`-th frame the displacements of the few since the last such frame, with a part of their
    affine motion, are put on the nodes of their grid, weighted by mass, and interpolated to the many. Where
    these have become denser than at rest they part, by at most a quarter of a cell of the scene's grid. A
    particle without a node with mass around it flies on under gravity. Particles stay between the walls and
    outside of obstacles, moving ones too. Sinks and emitters act on them by the rules that hold for the few.

    At the frames between, positions are interpolated from the last such frame when they are asked for, which
    changes nothing of what follows.

    Parameters
    ----------
    scene : Scene
        Its own particles, at frame 0, are those that are carried.
    few : Few
        At frame 0 as well; the upsampler reads it whenever it is asked for something.
    solver : _core.Solver
        Any solver of the scene with the grid of the few; its walls, obstacles, sinks and threads are taken.
    emitters : sequence of _core.Emitter
        Those of the scene, for its own particles.
    affine_share : float in [0, 1]
        Part of the affine motion that is taken over. All of it moves the centre of mass best, but lets
        particles clump.
    relaxation : float in [0, 8]
        How far particles part [cells] per density in excess and cell.

    Raises
    ------
    ConfigError
        A number is out of range.
    """

    def __init__(
        self,
        scene: Scene,
        few: Few,
        solver: _core.Solver,
        emitters: Sequence[_core.Emitter] = (),
        *,
        affine_share: float = 0.5,
        relaxation: float = 2.0,
    ) -> None:
        particles = scene.sample()
        self._few = few
        self._native = _core.Upsampler(
            solver,
            resolution=scene.resolution,
            affine_share=affine_share,
            relaxation=relaxation,
            emitters=emitters,
            max_particles=scene.max_particles,
            x=particles.x,
            v=particles.v,
            material=particles.material,
            mass=particles.mass,
            volume=particles.volume,
        )

    @property
    def every(self) -> int:
        """Number of frames from one carry to the next: 4, or 1 where particles come and go."""
        return self._native.every

    @property
    def particle_count(self) -> int:
        """Number N of particles at present."""
        return self._native.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that particles keep for good, ascending."""
        return self._native.ids

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (N,) into the scene's materials."""
        return self._native.material

    @property
    def mass(self) -> _Floats:
        """Masses (N,) [kg]."""
        return self._native.mass

    @property
    def emitters(self) -> list[str]:
        """What each emitter did in the latest frame; see `MpmSolver.emitters`."""
        return self._native.emitters

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m] at the frame of the few; a copy."""
        return self._native.positions(self._few.frame, **self._state())

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s] at the frame of the few, from theirs; a copy."""
        return self._native.velocities(self._few.frame, v=self._few.velocities, **self._state())

    def frames_to_update(self) -> int:
        """Return how many frames, at least 1, the few may advance before `follow` has to be called."""
        return self.every - self._few.frame % self.every

    def follow(self) -> None:
        """Carry all particles to the frame of the few, if it is one to carry at.

        Has to be called at each such frame, with the few at its end.
        """
        frame = self._few.frame
        if frame % self.every == 0 and frame > self._native.frame:
            self._native.update(frame, **self._state())

    def gather_force(self, force: _Floats) -> _Floats:
        """Return the accelerations (n, D) [m/s^2] of the few that those of the many, (N, D), stand for.

        They go to the nodes of the grid, weighted by mass, and from there to the few, both as they were at
        the latest carry: a force stays with the matter that it acts on.
        """
        return self._native.gather_force(force)

    def snapshot(self) -> bytes:
        """Return the complete state, without the few."""
        return self._native.snapshot()

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene; or change nothing and raise `SnapshotError`."""
        self._native.restore(data)

    def copy(self, few: Few | None = None) -> Self:
        """Return an independent upsampler in the same state, for a copy of the few or else for the same few."""
        twin = object.__new__(type(self))
        twin._few, twin._native = few or self._few, self._native.copy()
        return twin

    def _state(self) -> dict[str, Any]:
        few = self._few
        return {"ids": few.ids, "x": few.positions, "affine": few.affine, "mass": few.mass}


def refuse_other_upsampler(*, saved: bool, here: bool) -> None:
    """Refuse a snapshot that was taken with `show_all` by a simulator without, or the other way round."""
    if saved != here:
        raise SnapshotError(
            f"snapshot refused: it was taken with show_all={saved}, and this simulator has show_all={here}"
        )


def restored(upsampler: Upsampler | None, data: bytes | None, few: Few | None = None) -> Upsampler | None:
    """Return a copy of an upsampler, for `few` if given, in the state of a snapshot; None where neither is.

    Raises
    ------
    SnapshotError
        The snapshot is damaged, of another scene, or only one of upsampler and snapshot is there.
    """
    refuse_other_upsampler(saved=data is not None, here=upsampler is not None)
    if upsampler is None or data is None:
        return None
    twin = upsampler.copy(few)
    twin.restore(data)
    return twin

"""`Upsampler`: all particles of a scene, moved with the coarse particles that are simulated."""

from collections.abc import Sequence
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.errors import SnapshotError
from hybridmpm.scene import Scene

_Floats = npt.NDArray[np.float32]


class CoarseParticles(Protocol):
    """The n particles that a simulator moves, such as a compiled solver or a network."""

    @property
    def frame(self) -> int:
        """Number of frames since the start."""

    @property
    def particle_count(self) -> int:
        """Number n of particles."""

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Permanent ids (n,) of the particles, ascending."""

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (n,) into the scene's materials."""

    @property
    def positions(self) -> _Floats:
        """Positions (n, D) [m]."""

    @property
    def velocities(self) -> _Floats:
        """Velocities (n, D) [m/s]."""

    @property
    def affine(self) -> _Floats | None:
        """Velocity gradients (n, D, D) [1/s], as APIC's matrices; None if unknown."""

    @property
    def mass(self) -> _Floats:
        """Masses (n,) [kg]."""


class Upsampler:
    """All N particles of a scene, shown in coarse mode and moved with n coarse particles.

    At every `every`-th frame, displacements of the coarse particles since the previous update, with a part of
    their affine motion, are scattered to the nodes of their grid, weighted by mass, and interpolated to the
    shown particles. Shown particles that are denser than at rest are moved apart, by at most a quarter of a
    cell of the scene's grid in each pass. A particle without a node with mass nearby falls freely. Particles
    stay between the walls and outside obstacles and rigid bodies. Sinks and emitters act on them by the
    rules for coarse particles.

    At frames between two updates, positions are interpolated on demand, which does not change the simulation.

    Parameters
    ----------
    scene : Scene
        Its own particles, at frame 0, are the shown ones.
    coarse : CoarseParticles
        The simulated particles, at frame 0; read at each call.
    solver : _core.Solver
        Any solver of the scene on the coarse grid: walls, obstacles, sinks and threads are copied.
    emitters : sequence of _core.Emitter
        Emitters of the scene's own particles.
    affine_share : float in [0, 1]
        Part of the affine motion that is interpolated. With 1 the centre of mass is most accurate, but
        particles clump.
    relaxation : float in [0, 8]
        Displacement of shown particles in a pass of the density relaxation [cells] per excess density and
        cell.

    Raises
    ------
    ConfigError
        A number is out of range.
    """

    def __init__(
        self,
        scene: Scene,
        coarse: CoarseParticles,
        solver: _core.Solver,
        emitters: Sequence[_core.Emitter] = (),
        *,
        affine_share: float = 0.5,
        relaxation: float = 2.0,
    ) -> None:
        particles = scene.sample()
        self._coarse = coarse
        self._native = _core.Upsampler(
            solver,
            resolution=scene.resolution,
            cells=scene.cells,
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
    def native(self) -> _core.Upsampler:
        """The compiled upsampler."""
        return self._native

    @property
    def every(self) -> int:
        """Number of frames from one update to the next: 4, or 1 with emitters or sinks."""
        return self._native.every

    @property
    def particle_count(self) -> int:
        """Number N of particles at present."""
        return self._native.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Permanent ids (N,) of the particles, ascending."""
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
        """Status of each emitter in the latest frame; see `MpmSolver.emitters`."""
        return self._native.emitters

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m] at the frame of the coarse particles; a copy."""
        return self._native.positions(self._coarse.frame, **self._state())

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s] at the frame of the coarse particles, interpolated from theirs; a copy."""
        return self._native.velocities(self._coarse.frame, v=self._coarse.velocities, **self._state())

    def frames_to_update(self) -> int:
        """Return the number of frames, at least 1, until the next update."""
        return self.every - self._coarse.frame % self.every

    def update(self) -> None:
        """Move all particles to the frame of the coarse particles, if an update is due at it.

        To be called at the end of each frame at which one is due; nothing happens at other frames.
        """
        frame = self._coarse.frame
        if frame % self.every == 0 and frame > self._native.frame:
            self._native.update(frame, **self._state())

    def gather_force(self, force: _Floats) -> _Floats:
        """Return accelerations (n, D) [m/s^2] of the coarse particles from those of the shown ones, (N, D).

        They are scattered to the nodes of the grid, weighted by mass, and interpolated to the coarse
        particles, all at their positions of the latest update: so a force stays with the matter that it acts
        on.
        """
        return self._native.gather_force(force)

    def snapshot(self) -> bytes:
        """Return the complete state, without that of the simulator of the coarse particles."""
        return self._native.snapshot()

    def restore(self, data: bytes) -> None:
        """Restore the state of a snapshot of the same scene, or change nothing and raise `SnapshotError`."""
        self._native.restore(data)

    def copy(self, coarse: CoarseParticles | None = None) -> Self:
        """Return an independent upsampler in the same state, for other coarse particles if given."""
        twin = object.__new__(type(self))
        twin._coarse, twin._native = coarse or self._coarse, self._native.copy()
        return twin

    def _state(self) -> dict[str, Any]:
        coarse = self._coarse
        # Networks move no rigid bodies.
        rigid = coarse.rigid if isinstance(coarse, _core.Solver) else None
        return {
            "ids": coarse.ids,
            "x": coarse.positions,
            "affine": coarse.affine,
            "mass": coarse.mass,
            "rigid": rigid,
        }


def refuse_other_upsampler(*, saved: bool, here: bool) -> None:
    """Raise `SnapshotError` unless a snapshot and the present simulator agree in `show_all`."""
    if saved != here:
        raise SnapshotError(
            f"snapshot refused: it was taken with show_all={saved}, and this simulator has show_all={here}"
        )


def restored(
    upsampler: Upsampler | None, data: bytes | None, coarse: CoarseParticles | None = None
) -> Upsampler | None:
    """Return a copy of an upsampler in the state of a snapshot, or None if both are None.

    Parameters
    ----------
    upsampler : Upsampler or None
    data : bytes or None
        Snapshot of an upsampler of the same scene.
    coarse : CoarseParticles, optional
        Coarse particles of the copy; those of `upsampler` if absent.

    Raises
    ------
    SnapshotError
        The snapshot is damaged or of another scene, or only one of upsampler and snapshot is None.
    """
    refuse_other_upsampler(saved=data is not None, here=upsampler is not None)
    if upsampler is None or data is None:
        return None
    twin = upsampler.copy(coarse)
    twin.restore(data)
    return twin

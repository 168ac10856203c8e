"""`MpmState`: what can be read off an MPM solver."""

from typing import Any, ClassVar, cast

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.decisions import Decision, Mode
from hybridmpm.downsampling import Carrier, Rung
from hybridmpm.mpm.frames import Frames
from hybridmpm.scene import Scene
from hybridmpm.scene.openings import EmitterStatus
from hybridmpm.simulator import Kind, Simulator


class MpmState(Simulator):
    """The part of `MpmSolver` that reads: N particles are shown, n simulated, D is the dimension."""

    kind: ClassVar[Kind] = "mpm"

    _scene: Scene
    _rung: Rung
    _frames: Frames
    _types: npt.NDArray[np.uint8]

    @property
    def _shown(self) -> _native.Solver | Carrier:
        """Who knows the particles that are shown."""
        return self._frames.solver if self._frames.carrier is None else self._frames.carrier

    @property
    def scene(self) -> Scene:
        """The scene that this solver was made from."""
        return self._scene

    @property
    def resolution(self) -> int:
        """Grid cells per metre; fewer than the scene's where `r_p` or `rung` asks for a coarser grid."""
        return self._frames.solver.resolution

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._frames.solver.frame

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""
        return self._rung.r_p

    @property
    def rung(self) -> Rung | None:
        """Settings of the fitted rung that few particles simulate at; None without `rung`."""
        return None if self._rung.name is None else self._rung

    @property
    def redone_frames(self) -> tuple[int, ...]:
        """Numbers of the frames that failed at the long step of a rung and were done again at the safe one.

        Counted are those since this solver was made or loaded, up to the present frame.
        """
        return self._frames.redone

    @property
    def particle_spacing(self) -> float:
        """Distance of the particles of `positions` at rest [m]: above the scene's where they are merged."""
        return super().particle_spacing if self._frames.carrier is None else self.scene.spacing

    @property
    def r_t(self) -> int:
        """1: MPM makes every frame."""
        return 1

    @property
    def mode(self) -> Mode:
        """Who simulates the next frame: always "mpm"."""
        return "mpm"

    @property
    def log(self) -> tuple[Decision, ...]:
        """Empty: nobody else ever simulates."""
        return ()

    @property
    def particle_count(self) -> int:
        """Number N of particles at present."""
        return self._shown.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that particles keep for good, ascending: 0, 1, ... in the order in which they came."""
        return self._shown.ids

    @property
    def emitters(self) -> tuple[EmitterStatus, ...]:
        """What each emitter did in the latest frame: "waiting", "running", "blocked", "full" or "ended"."""
        return cast("tuple[EmitterStatus, ...]", tuple(self._shown.emitters))

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Positions (N, D) [m]; a copy."""
        return self._shown.positions

    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Velocities (N, D) [m/s]; a copy."""
        return self._shown.velocities

    @property
    def coarse_positions(self) -> npt.NDArray[np.float32]:
        """Positions (n, D) [m] of the particles that are simulated: without `carry` all; a copy."""
        return self._frames.solver.positions

    @property
    def affine(self) -> npt.NDArray[np.float32]:
        """APIC matrices C (n, D, D) [1/s] of the particles that are simulated; a copy."""
        return self._frames.solver.affine

    @property
    def volume_ratio(self) -> npt.NDArray[np.float32]:
        """Volume over rest volume (n,) [-] of those simulated: J of water, det F of solids; a copy."""
        return self._frames.solver.volume_ratio

    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Whether each particle simulated (n,) sleeps; a copy. None does without a `Sleep`."""
        return self._frames.solver.asleep

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,), read-only: 5 water, 6 sand, 7 elastic (goop)."""
        return _read_only(self._types[self._shown.material])

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """Masses (N,) [kg], read-only; in 2D those of a slice one metre deep."""
        return _read_only(self._shown.mass)

    @property
    def last_frame(self) -> _native.FrameReport | None:
        """How the latest frame was cut into substeps; None before the first."""
        return self._frames.last

    def diagnostics(self) -> _native.Diagnostics:
        """Mass, momentum, energies and extremes over the particles simulated, at this instant."""
        return self._frames.solver.diagnostics()


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array

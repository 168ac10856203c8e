"""`MpmState`: what can be read off an MPM solver."""

from typing import ClassVar, cast

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.coarse import CoarseLevel, CoarseSimulator, Upsampler
from hybridmpm.decisions import Decision, Mode
from hybridmpm.mpm.frames import Frames
from hybridmpm.probes.probe import PressureSamples
from hybridmpm.scene import Scene
from hybridmpm.scene.openings import EmitterStatus
from hybridmpm.simulator import Kind


class MpmState(CoarseSimulator):
    """The part of `MpmSolver` that reads: N particles are shown, n simulated, D is the dimension."""

    kind: ClassVar[Kind] = "mpm"

    _scene: Scene
    _level: CoarseLevel
    _frames: Frames

    @property
    def _few(self) -> _core.Solver:
        return self._frames.solver

    @property
    def _upsampler(self) -> Upsampler | None:
        return self._frames.upsampler

    @property
    def scene(self) -> Scene:
        """The scene that this solver was made from."""
        return self._scene

    @property
    def resolution(self) -> int:
        """Grid cells per metre; fewer than the scene's where `r_p` or `coarse` asks for a coarser grid."""
        return self._frames.solver.resolution

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._frames.solver.frame

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""
        return self._level.r_p

    @property
    def coarse(self) -> CoarseLevel | None:
        """Settings of the fitted coarse level that few particles simulate at; None without `coarse`."""
        return None if self._level.name is None else self._level

    @property
    def redone_frames(self) -> tuple[int, ...]:
        """Numbers of the frames that failed at the long step of a coarse level and were done again at the safe one.

        Counted are those since this solver was made or loaded, up to the present frame.
        """
        return self._frames.redone

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
    def emitters(self) -> tuple[EmitterStatus, ...]:
        """What each emitter did in the latest frame: "waiting", "running", "blocked", "full" or "ended"."""
        return cast("tuple[EmitterStatus, ...]", tuple((self._upsampler or self._few).emitters))

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (n,) into the scene's materials of the particles simulated; a snapshot, read-only."""
        return self._frames.solver.material

    @property
    def affine(self) -> npt.NDArray[np.float32]:
        """APIC matrices C (n, D, D) [1/s] of the particles simulated; a snapshot, read-only."""
        return self._frames.solver.affine

    @property
    def volume_ratio(self) -> npt.NDArray[np.float32]:
        """Volume over rest volume (n,) [-] of those simulated, J of water, det F of solids; read-only."""
        return self._frames.solver.volume_ratio

    @property
    def pressure(self) -> npt.NDArray[np.float32]:
        """Pressure -tr(sigma) / D (n,) [Pa] of those simulated, above 0 in compression; read-only."""
        return self._frames.solver.pressure

    def pressure_samples(self) -> PressureSamples:
        """Return the pressures of the n particles simulated."""
        spacing = self.scene.spacing / self.r_p ** (1 / self.dim)
        return PressureSamples(self.coarse_positions, self.pressure, float(spacing))

    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Whether each particle simulated (n,) sleeps, read-only. None does without a `Sleep`."""
        return self._frames.solver.asleep

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """How the latest frame was cut into substeps; None before the first."""
        return self._frames.last

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over the particles simulated, at this instant."""
        return self._frames.solver.diagnostics()

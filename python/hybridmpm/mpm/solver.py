"""`MpmSolver`: a scene and the compiled MLS-MPM solver that moves it."""

import copy
import warnings
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, cast

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm._support.arguments import float32, whole
from hybridmpm.decisions import Decision, Mode
from hybridmpm.downsampling import Carrier
from hybridmpm.downsampling.merging import checked_ratio
from hybridmpm.errors import ConfigError, CostlyMaterialWarning, ThinObstacleWarning
from hybridmpm.force import CheckedForce
from hybridmpm.mpm import joint_state
from hybridmpm.mpm.build import carrier_of, native_solver
from hybridmpm.mpm.cost import costly_materials
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.scene import ParticleLimitWarning, Scene
from hybridmpm.scene.openings import EmitterStatus
from hybridmpm.simulator import Kind, Simulator
from hybridmpm.snapshots import SavedState

Substeps = Literal["cfl", "reference"] | int
MAX_SUBSTEPS = 20_000


class MpmSolver(Simulator):
    """MLS-MPM (Hu et al. 2018) on a scene. Safe to share between threads: calls wait for each other.

    Parameters
    ----------
    scene : Scene
    substeps : "cfl", "reference" or int in [1, 20000]
        "cfl": the fewest that the CFL bound allows. "reference": floor(frame_dt / (0.02 dx)) + 1 a frame,
        the ground truth's rule. An integer: that many equal substeps a frame.
    cfl : float in (0, 1], optional
        CFL number of "cfl" substeps; each material's own if absent, 1.5 times below its measured limit.
    allow_unstable : bool
        Let a fixed number of substeps go above the stability limit.
    sleep : Sleep, optional
        Let regions at rest sleep: their particles keep still and cost nothing until something moves near
        them, a force acts on them or a moving obstacle approaches. Not for ground truth.
    r_p : float in (0, 1]
        Ratio of the particles to those of the scene: they are merged (`downsampling.merge`), and the grid is
        coarsened until a cell holds two (`downsampling.coarse_resolution`).
    carry : bool
        With `r_p` below 1: carry all particles of the scene along with the few that are simulated
        (`downsampling.Carrier`). `positions`, `velocities`, `ids`, `mass` and `materials` are then those of
        the whole scene, and forces are given for them; `coarse_positions` are those of the few.
    threads : int in [1, 1024]
        The result does not depend on it, to the bit.

    Raises
    ------
    SceneError
        The scene cannot be filled with particles.
    ConfigError
        A setting is out of range.

    Warns
    -----
    ThinObstacleWarning
        An obstacle is thinner than two grid cells.
    CostlyMaterialWarning
        A body is so light or so stiff that each frame takes 200 substeps or more.

    Notes
    -----
    N is the number of particles, D the dimension. Particles keep their order for good. A frame that fails
    raises `NonFiniteError`, `DomainError`, `InvertedError` or `StepSizeError`, and the state is the one
    before that frame.

    Emitters and sinks act at the end of each frame and so change N: those that stay keep their order, new
    ones come last, and `ids` tells who is who. An emitter that finds `max_particles` in the scene stops, with
    a `ParticleLimitWarning`.
    """

    kind: ClassVar[Kind] = "mpm"

    def __init__(
        self,
        scene: Scene,
        *,
        substeps: Substeps = "cfl",
        cfl: float | None = None,
        allow_unstable: bool = False,
        sleep: Sleep | None = None,
        r_p: float = 1.0,
        carry: bool = False,
        threads: int = 1,
    ) -> None:
        self._scene = scene
        self._substeps: Substeps = (
            substeps if isinstance(substeps, str) else whole("substeps", substeps, 1, MAX_SUBSTEPS)
        )
        self._cfl = cfl
        if not isinstance(sleep, Sleep | None):
            raise ConfigError(f"sleep must be Sleep(...), or None where nothing may sleep, got {sleep!r}")
        self._sleep = sleep
        self._allow_unstable = allow_unstable
        self._r_p = checked_ratio(r_p)
        self._types = np.array([material.type_id for material in scene.materials], dtype=np.uint8)
        self._limit_told = False
        self._solver = native_solver(
            scene,
            substeps=self._substeps,
            cfl=cfl,
            allow_unstable=allow_unstable,
            sleep=sleep,
            r_p=self._r_p,
            threads=whole("threads", threads, 1, 1024),
        )
        self._carrier = carrier_of(scene, self._solver, self._r_p, carry=carry)
        if substeps == "cfl":
            for text in costly_materials(scene, self.resolution, cfl):
                warnings.warn(text, CostlyMaterialWarning, stacklevel=2)
        for text in scene.thin_obstacles():
            warnings.warn(text, ThinObstacleWarning, stacklevel=2)
        self._start = self.snapshot()

    @property
    def _shown(self) -> _native.Solver | Carrier:
        """Who knows the particles that are shown."""
        return self._solver if self._carrier is None else self._carrier

    @property
    def scene(self) -> Scene:
        """The scene that this solver was made from."""
        return self._scene

    @property
    def resolution(self) -> int:
        """Grid cells per metre; fewer than the scene's where `r_p` asks for a coarser grid."""
        return self._solver.resolution

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._solver.frame

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""
        return self._r_p

    @property
    def particle_spacing(self) -> float:
        """Distance of the particles of `positions` at rest [m]: above the scene's where they are merged."""
        return super().particle_spacing if self._carrier is None else self.scene.spacing

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
        return self._solver.positions

    @property
    def affine(self) -> npt.NDArray[np.float32]:
        """APIC matrices C (n, D, D) [1/s] of the particles that are simulated; a copy."""
        return self._solver.affine

    @property
    def volume_ratio(self) -> npt.NDArray[np.float32]:
        """Volume over rest volume (n,) [-] of those simulated: J of water, det F of solids; a copy."""
        return self._solver.volume_ratio

    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Whether each particle simulated (n,) sleeps; a copy. None does without a `Sleep`."""
        return self._solver.asleep

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
        return self._solver.last_frame

    def _advance(self, frames: int, force: CheckedForce, path: npt.NDArray[np.float32] | None) -> None:
        if self._carrier is not None:
            self._advance_carried(frames, force, path)
        elif force.by_frame:
            super()._advance(frames, force, path)
        else:
            # The core goes through all frames in one call.
            self._solver.advance(frames, force.array, path)
        self._tell_limit(stacklevel=4)

    def _advance_carried(
        self, frames: int, force: CheckedForce, path: npt.NDArray[np.float32] | None
    ) -> None:
        if force.by_frame or path is not None or (force.array is not None and force.array.ndim > 1):
            super()._advance(frames, force, path)
            return
        carrier = cast("Carrier", self._carrier)
        last = self.frame + frames
        while self.frame < last:
            self._solver.advance(min(carrier.frames_to_carry(), last - self.frame), force.array)
            carrier.follow()

    def _advance_frame(self, force: npt.NDArray[np.float32] | None) -> None:
        if self._carrier is None:
            self._solver.advance(1, force)
            return
        if force is not None and force.ndim == 2:
            force = self._carrier.gather_force(force)
        self._solver.advance(1, force)
        self._carrier.follow()

    def cancel_by(self, flag: _native.CancelFlag) -> None:
        """Let another thread end the frame that is being computed; see `Simulator.cancel_by`."""
        super().cancel_by(flag)
        self._solver.cancel_by(flag)

    def prescribe(
        self,
        x: npt.ArrayLike,
        v: npt.ArrayLike,
        frame: int,
        *,
        affine: bool = True,
        deform: bool = False,
    ) -> _native.MotionReport:
        """Put the particles where somebody else, e.g. a network, says that they are at the end of a frame.

        Parameters
        ----------
        x, v : (N, D)
            Positions [m] and velocities [m/s]. A particle in an obstacle, or past a wall by less than a grid
            cell, is put back to its surface.
        frame : int in [0, 2**53]
            Its number, which becomes that of the solver.
        affine : bool
            Take the affine matrices C from grid velocities, given by a substep's transfers; else C is 0.
        deform : bool
            Deform the materials by C over the frames since the present one, with the return mapping of sand;
            else J, F and the like stay as they are. Nothing leads the stress back while motion is prescribed,
            so the errors of C add up: within 20 frames J of water strays by ten times its own variation.

        Raises
        ------
        NonFiniteError, DomainError, InvertedError
            Naming the particle. The state is then the one before.
        ConfigError
            Wrong shapes, or the solver has emitters, sinks, `sleep` or `carry`.
        """
        if self._carrier is not None:
            raise ConfigError(
                "prescribe is for solvers without carry=True: nothing tells how the particles that are "
                "carried would have moved meanwhile"
            )
        return self._solver.prescribe(
            float32("x", x, "(N, D)"),
            float32("v", v, "(N, D)"),
            whole("frame", frame, 0, 2**53),
            affine=affine,
            deform=deform,
        )

    def _tell_limit(self, stacklevel: int) -> None:
        """Warn, once, where an emitter has stopped because of `max_particles`."""
        if not self._limit_told and "full" in self._shown.emitters:
            self._limit_told = True
            warnings.warn(
                f"an emitter has stopped: the scene holds max_particles = {self._scene.max_particles}",
                ParticleLimitWarning,
                stacklevel=stacklevel,
            )

    def snapshot(self) -> bytes:
        """Complete state, versioned and checksummed. Going on from it gives the same bits."""
        return joint_state.encode(self._solver, self._carrier)

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene.

        Raises
        ------
        SnapshotError
            The bytes are damaged or of another scene; the present state is then untouched.
        """
        joint_state.restore(self._solver, self._carrier, data)

    def _settings_to_save(self) -> dict[str, Any]:
        return {
            "substeps": self._substeps,
            "cfl": self._cfl,
            "allow_unstable": self._allow_unstable,
            "sleep": None if self._sleep is None else self._sleep.model_dump(),
            "r_p": self._r_p,
            "carry": self._carrier is not None,
        }

    @classmethod
    def load(cls, path: str | Path, *, threads: int = 1) -> Self:
        """Build the solver of a file that `save` wrote, in the state it was in.

        Parameters
        ----------
        path : str or Path
        threads : int in [1, 1024]
            May differ from before; the result does not depend on it.

        Raises
        ------
        SnapshotError
            The file is foreign, damaged, cut off or of a version that this library does not read; the message
            names it.
        OSError
            The file cannot be read.
        """
        threads = whole("threads", threads, 1, 1024)

        def make(saved: SavedState) -> Any:
            settings = dict(saved.settings)
            sleep = settings.pop("sleep")
            sleeping = None if sleep is None else Sleep.model_validate(sleep)
            return cls(saved.scene, **settings, sleep=sleeping, threads=threads)

        return cls._restored(path, make)

    def copy(self) -> Self:
        """Return an independent solver in the same state."""
        twin = copy.copy(self)
        twin._solver = self._solver.copy()  # noqa: SLF001 - of this very class
        if self._carrier is not None:
            twin._carrier = self._carrier.copy(twin._solver)  # noqa: SLF001
        return twin

    def reset(self) -> None:
        """Go back to frame 0."""
        self.restore(self._start)

    def diagnostics(self) -> _native.Diagnostics:
        """Mass, momentum, energies and extremes over the particles simulated, at this instant."""
        return self._solver.diagnostics()


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array

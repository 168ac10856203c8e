"""`MpmSolver`: a scene and the compiled MLS-MPM solver that moves it."""

import copy
import warnings
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm._support.arguments import float32, whole
from hybridmpm.downsampling import coarse_resolution, merge
from hybridmpm.downsampling.merge import checked_ratio
from hybridmpm.errors import ConfigError, SnapshotError, ThinObstacleWarning
from hybridmpm.mpm.emission import native_emitters
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.mpm.snapshots import SavedState, Substeps, read_state, write_state
from hybridmpm.scene import ParticleLimitWarning, Scene
from hybridmpm.scene.openings import EmitterStatus

MAX_FRAMES_AT_ONCE = 1_000_000
MAX_SUBSTEPS = 20_000


class MpmSolver:
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

    Notes
    -----
    N is the number of particles, D the dimension. Particles keep their order for good. A frame that fails
    raises `NonFiniteError`, `DomainError`, `InvertedError` or `StepSizeError`, and the state is the one
    before that frame.

    Emitters and sinks act at the end of each frame and so change N: those that stay keep their order, new
    ones come last, and `ids` tells who is who. An emitter that finds `max_particles` in the scene stops, with
    a `ParticleLimitWarning`.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        substeps: Substeps = "cfl",
        cfl: float | None = None,
        allow_unstable: bool = False,
        sleep: Sleep | None = None,
        r_p: float = 1.0,
        threads: int = 1,
    ) -> None:
        self._scene = scene
        self._substeps: Substeps = (
            substeps if isinstance(substeps, str) else whole("substeps", substeps, 1, MAX_SUBSTEPS)
        )
        self._cfl = cfl
        self._sleep = sleep
        self._allow_unstable = allow_unstable
        self._r_p = checked_ratio(r_p)
        if self._r_p < 1 and scene.emitters:
            raise ConfigError("r_p below 1 is for scenes without emitters: what they add is not merged")
        particles = merge(scene.sample(), r_p)
        self._types = np.array([material.type_id for material in scene.materials], dtype=np.uint8)
        self._limit_told = False
        self._solver = _native.Solver(
            resolution=coarse_resolution(scene, r_p),
            frame_dt=scene.frame_dt,
            gravity=scene.gravity,
            wall_lower=scene.walls.lower,
            wall_upper=scene.walls.upper,
            wall_contact=scene.walls.contact,
            wall_friction=scene.walls.friction,
            materials=[material.to_native(scene.potential_drop) for material in scene.materials],
            obstacles=[obstacle.to_native() for obstacle in scene.obstacles],
            emitters=native_emitters(scene),
            sinks=[sink.to_native() for sink in scene.sinks],
            max_particles=scene.max_particles,
            x=particles.x,
            v=particles.v,
            material=particles.material,
            mass=particles.mass,
            volume=particles.volume,
            substeps=self._substeps,
            cfl=cfl,
            sleep_speed=None if sleep is None else sleep.speed,
            sleep_frames=1 if sleep is None else sleep.frames,
            allow_unstable=allow_unstable,
            threads=whole("threads", threads, 1, 1024),
        )
        for text in scene.thin_obstacles():
            warnings.warn(text, ThinObstacleWarning, stacklevel=2)
        self._start = self._solver.snapshot()

    @property
    def scene(self) -> Scene:
        """The scene that this solver was made from."""
        return self._scene

    @property
    def dim(self) -> int:
        """D, 2 or 3."""
        return self._scene.dim

    @property
    def resolution(self) -> int:
        """Grid cells per metre; fewer than the scene's where `r_p` asks for a coarser grid."""
        return self._solver.resolution

    @property
    def frame(self) -> int:
        """Frames done since the start."""
        return self._solver.frame

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self._solver.time

    @property
    def particle_count(self) -> int:
        """N, at present."""
        return self._solver.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that particles keep for good, ascending: 0, 1, ... in the order in which they came."""
        return self._solver.ids

    @property
    def emitters(self) -> tuple[EmitterStatus, ...]:
        """What each emitter did in the latest frame: "waiting", "running", "blocked", "full" or "ended"."""
        return cast("tuple[EmitterStatus, ...]", tuple(self._solver.emitters))

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m]; a copy."""
        return self._solver.positions

    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m/s]; a copy."""
        return self._solver.velocities

    @property
    def affine(self) -> npt.NDArray[np.float32]:
        """APIC matrix C, snapshot (N, D, D) [1/s]; a copy."""
        return self._solver.affine

    @property
    def volume_ratio(self) -> npt.NDArray[np.float32]:
        """J of water, det F of solids, snapshot (N,) [-]; a copy."""
        return self._solver.volume_ratio

    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Which particles sleep, snapshot (N,); a copy. None does unless the solver was given a `Sleep`."""
        return self._solver.asleep

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,), read-only: 5 water, 6 sand, 7 elastic (goop)."""
        return _read_only(self._types[self._solver.material])

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """(N,) [kg], read-only; in 2D of a slice one metre deep."""
        return _read_only(self._solver.mass)

    @property
    def last_frame(self) -> _native.FrameReport | None:
        """How the latest frame was cut into substeps; None before the first."""
        return self._solver.last_frame

    def advance(self, frames: int = 1, force: npt.ArrayLike | None = None) -> None:
        """Go on by whole frames.

        Parameters
        ----------
        frames : int in [0, 1000000]
        force : (N, D) or (frames, N, D), optional
            External acceleration [m/s^2] besides gravity, held over the call or given per frame. Taken as
            float32. In a scene with emitters or sinks only for one frame at a time, of the N before it.

        Raises
        ------
        NonFiniteError, DomainError, InvertedError, StepSizeError
            Naming particle and frame. The state is then the one before the failed frame.
        ConfigError
            `frames` out of range or `force` of a wrong shape; nothing has moved.
        """
        self._solver.advance(whole("frames", frames, 0, MAX_FRAMES_AT_ONCE), acceleration("force", force))
        self._tell_limit()

    def rollout(self, frames: int, force: npt.ArrayLike | None = None) -> npt.NDArray[np.float32]:
        """Advance, and return where the particles were on the way.

        Parameters and errors are those of `advance`.

        Returns
        -------
        float32 (frames + 1, N, D)
            Positions [m]; the first row is the state before the call.

        Raises
        ------
        ConfigError
            The scene has emitters or sinks, so N may change: `hybridmpm.recording.record` follows them.
        """
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        if self._scene.is_open:
            raise ConfigError(
                "rollout needs a fixed number of particles, but this scene has emitters or sinks; "
                "hybridmpm.recording.record follows particles that come and go"
            )
        path = np.empty((frames + 1, self.particle_count, self.dim), dtype=np.float32)
        path[0] = self.positions
        self._solver.advance(frames, acceleration("force", force), path[1:])
        return path

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
            Wrong shapes, or the scene has emitters, sinks or `sleep`.
        """
        return self._solver.prescribe(
            float32("x", x, "(N, D)"),
            float32("v", v, "(N, D)"),
            whole("frame", frame, 0, 2**53),
            affine=affine,
            deform=deform,
        )

    def _tell_limit(self) -> None:
        """Warn, once, where an emitter has stopped because of `max_particles`."""
        if not self._limit_told and "full" in self._solver.emitters:
            self._limit_told = True
            warnings.warn(
                f"an emitter has stopped: the scene holds max_particles = {self._scene.max_particles}",
                ParticleLimitWarning,
                stacklevel=3,
            )

    def snapshot(self) -> bytes:
        """Complete state, versioned and checksummed. Going on from it gives the same bits."""
        return self._solver.snapshot()

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene.

        Raises
        ------
        SnapshotError
            The bytes are damaged or of another scene; the present state is then untouched.
        """
        self._solver.restore(data)

    def save(self, path: str | Path) -> None:
        """Write scene, settings and state to a file that `load` goes on from with the same bits.

        The file appears under its name only once it is complete.

        Raises
        ------
        ExportError
            The folder does not exist or refuses the file.
        """
        saved = SavedState(
            scene=self._scene,
            substeps=self._substeps,
            cfl=self._cfl,
            allow_unstable=self._allow_unstable,
            sleep=self._sleep,
            r_p=self._r_p,
            frame=self.frame,
            state=self.snapshot(),
        )
        write_state(Path(path), saved)

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
        saved = read_state(Path(path))
        threads = whole("threads", threads, 1, 1024)
        try:
            solver = cls(
                saved.scene,
                substeps=saved.substeps,
                cfl=saved.cfl,
                allow_unstable=saved.allow_unstable,
                sleep=saved.sleep,
                r_p=saved.r_p,
                threads=threads,
            )
            solver.restore(saved.state)
        except (ConfigError, SnapshotError) as error:
            raise SnapshotError(f"{path} cannot be taken up by this version: {error}") from error
        return solver

    def copy(self) -> Self:
        """Return an independent solver in the same state."""
        twin = copy.copy(self)
        twin._solver = self._solver.copy()  # noqa: SLF001 - of this very class
        return twin

    def reset(self) -> None:
        """Go back to frame 0."""
        self._solver.restore(self._start)

    def diagnostics(self) -> _native.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant."""
        return self._solver.diagnostics()


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array


def acceleration(name: str, force: npt.ArrayLike | None) -> npt.NDArray[np.float32] | None:
    """Return an external acceleration as the core takes it, or raise `ConfigError` naming it."""
    return None if force is None else float32(name, force, "(N, D)", "(frames, N, D)")

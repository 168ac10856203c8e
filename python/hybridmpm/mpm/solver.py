"""`MpmSolver`: MLS-MPM on a scene."""

import math
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, cast

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support import signals
from hybridmpm._support.arguments import flag, float32, whole
from hybridmpm.coarse import CoarseLevel, CoarseSimulator, Upsampler, coarse_level, coarse_warnings, merge
from hybridmpm.coarse.upsampler import CoarseParticles
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import (
    CoarseWarning,
    ConfigError,
    CostlyMaterialWarning,
    RoundedWorldWarning,
    SoftMaterialWarning,
    ThinObstacleWarning,
    TornBodyWarning,
)
from hybridmpm.force import CheckedForce
from hybridmpm.mpm.build import native_solver, upsampler_of
from hybridmpm.mpm.cost import costly_materials
from hybridmpm.mpm.rigid import RigidBodies
from hybridmpm.mpm.scene_warnings import soft_materials
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.mpm.stepper import MpmStepper
from hybridmpm.mpm.tearing import WHOLE, largest_piece, torn_bodies
from hybridmpm.probes.probe import PressureSamples
from hybridmpm.scenarios.checked import checked_scene
from hybridmpm.scene import Elastic, ParticleLimitWarning, Scene
from hybridmpm.scene.openings import EmitterStatus
from hybridmpm.scene.world import rounded_up
from hybridmpm.simulator import Kind
from hybridmpm.snapshots import SavedState

Substeps = Literal["cfl", "reference"] | int
_TEARING_PERIOD = 32
"""Frames between two searches for bodies that have come apart."""


class MpmSolver(CoarseSimulator):
    """MLS-MPM (Hu et al. 2018) on a scene. Safe to share between threads: one call runs at a time.

    Parameters
    ----------
    scene : Scene
    substeps : "cfl", "reference" or int in [1, 20000]
        "cfl": the fewest that the CFL law allows. "reference": floor(frame_dt / (0.02 dx)) + 1 a frame,
        the ground truth's rule. An integer: that many equal substeps a frame.
    cfl : float in (0, 1], optional
        CFL number of "cfl" substeps; each material's own if absent, 1.5 times below its measured limit.
    allow_unstable : bool
        Let a fixed number of substeps go above the stability limit.
    sleep : Sleep, optional
        Let regions at rest sleep. Their particles keep still and cost nothing until matter moves near them, a
        force acts on them or a moving obstacle approaches. Not for ground truth.
    r_p : float in (0, 1]
        Ratio of the particles simulated to those of the scene. Particles are merged (`coarse.merge`), and the
        grid is coarsened until a cell holds two (`coarse.coarse_resolution`).
    show_all : bool
        With `r_p` below 1: show all particles of the scene, interpolated from those simulated
        (`coarse.Upsampler`). `positions`, `velocities`, `ids`, `mass` and `materials` are then those of the
        whole scene, and forces are given for them; `coarse_positions` are those simulated.
    coarse : str or CoarseLevel, optional
        Coarse mode. Name of a fitted level, such as "1/16" (`coarse.coarse_table` lists them), or its
        settings: ratio of the particles, grid, moduli and step, fitted for the smallest error in a given
        time. All particles are shown. Not together with `substeps`, `cfl` or `r_p`. A frame that fails at the
        coarse level's step is done again at the safe one (`redone_frames`).
    threads : int in [1, 1024]
        The result does not depend on it, to the bit.

    Raises
    ------
    SceneError
        `scene` is no Scene, or it cannot be filled with particles.
    ConfigError
        A setting is out of range.

    Warns
    -----
    ThinObstacleWarning
        An obstacle is thinner than half a grid cell.
    CostlyMaterialWarning
        A body is so light or so stiff that each frame takes 200 substeps or more.
    RoundedWorldWarning
        The size of the world is no whole number of grid cells.
    SoftMaterialWarning
        A material is compressed by its own weight by a tenth or more.
    CoarseWarning
        The scene is or becomes faster than those that the coarse level was fitted to, an obstacle or the
        layer of all matter at rest is thinner than a cell of its grid, or a frame had to be done again.
    TornBodyWarning
        From `advance`: an elastic body has come apart. Looked for every 32 frames.

    Notes
    -----
    N is the number of particles, D the dimension. Particles keep their order for good. A frame that fails
    raises `NonFiniteError`, `DomainError`, `InvertedError` or `StepSizeError`, and the state is the one
    before that frame.

    Emitters and sinks act at the end of each frame and change N: particles that stay keep their order and
    their `ids`, and new ones come last. An emitter stops at `max_particles`, with a `ParticleLimitWarning`.
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
        show_all: bool = False,
        coarse: str | CoarseLevel | None = None,
        threads: int = 1,
    ) -> None:
        self._scene = checked_scene(scene)
        self._substeps: Substeps = (
            substeps if isinstance(substeps, str) else whole("substeps", substeps, 1, _core.MAX_SUBSTEPS)
        )
        self._cfl = cfl
        if not isinstance(sleep, Sleep | None):
            raise ConfigError(f"sleep must be Sleep(...), or None where nothing may sleep, got {sleep!r}")
        self._sleep = sleep
        self._allow_unstable = allow_unstable
        if coarse is None:
            self._level = CoarseLevel.unfitted(scene, r_p)
        else:
            _refuse_beside_coarse(substeps=substeps != "cfl", cfl=cfl is not None, r_p=r_p != 1)
            if isinstance(coarse, CoarseLevel):
                self._level = _checked(coarse, scene)
            else:
                self._level = coarse_level(scene, coarse)
                for text in coarse_warnings(scene, self._level):
                    warnings.warn(text, CoarseWarning, stacklevel=2)
            show_all = True
        self._warned: frozenset[str] = frozenset()
        self._threads = whole("threads", threads, 1, 1024)
        particles = merge(scene.sample(), self._level.r_p)
        self._bodies = particles.body
        build = partial(
            native_solver,
            scene,
            particles,
            substeps=self._substeps,
            allow_unstable=allow_unstable,
            sleep=sleep,
            level=self._level,
            threads=self._threads,
        )
        solver = build(cfl=cfl if coarse is None else self._level.cfl)
        self._stepper = MpmStepper(
            solver,
            upsampler_of(scene, solver, solver, self._level) if flag("show_all", show_all) else None,
            safe=None if self._level.cfl is None else partial(build, cfl=None),
            speed_warning=math.inf if self._level.fastest is None else self._level.fastest,
        )
        if substeps == "cfl":
            for text in costly_materials(scene, self.resolution, cfl):
                warnings.warn(text, CostlyMaterialWarning, stacklevel=2)
        for category, text in _warnings_of(scene):
            warnings.warn(text, category, stacklevel=2)
        self._start = self.snapshot()

    def _traits(self) -> list[str]:
        if self.coarse is not None:
            return [f"coarse level {self.coarse.name!r}"]
        if self.r_p == 1:
            return []
        return [f"r_p = {self.r_p:.4g}, all shown" if self._upsampler else f"r_p = {self.r_p:.4g}"]

    @property
    def _solver(self) -> _core.Solver:
        """The compiled solver of the particles simulated."""
        return self._stepper.solver

    @property
    def _coarse(self) -> _core.Solver:
        return self._solver

    @property
    def _upsampler(self) -> Upsampler | None:
        return self._stepper.upsampler

    @property
    def scene(self) -> Scene:
        """The scene that this solver was made from."""
        return self._scene

    @property
    def resolution(self) -> int:
        """Grid cells per metre; fewer than the scene's where `r_p` or `coarse` makes the grid coarser."""
        return self._solver.resolution

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._solver.frame

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene, in (0, 1]."""
        return self._level.r_p

    @property
    def coarse(self) -> CoarseLevel | None:
        """Settings of the fitted coarse level; None without `coarse`."""
        return None if self._level.name is None else self._level

    @property
    def redone_frames(self) -> tuple[int, ...]:
        """Numbers of the frames that failed at a coarse level's step and were done again at the safe one.

        Counted are those since this solver was made or loaded, up to the present frame.
        """
        return self._stepper.redone

    @property
    def r_t(self) -> int:
        """1: MPM makes every frame."""
        return 1

    @property
    def mode(self) -> Mode:
        """Simulator of the next frame: always "mpm"."""
        return "mpm"

    @property
    def log(self) -> tuple[Decision, ...]:
        """Empty: MPM simulates every frame."""
        return ()

    @property
    def emitters(self) -> tuple[EmitterStatus, ...]:
        """Status of each emitter in the latest frame: "waiting", "running", "blocked", "full" or "ended"."""
        return cast("tuple[EmitterStatus, ...]", tuple((self._upsampler or self._coarse).emitters))

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (n,) into the scene's materials of the particles simulated; a snapshot, read-only."""
        return self._solver.material

    @property
    def affine(self) -> npt.NDArray[np.float32]:
        """APIC matrices C (n, D, D) [1/s] of the particles simulated; a snapshot, read-only."""
        return self._solver.affine

    @property
    def volume_ratio(self) -> npt.NDArray[np.float32]:
        """Volume over rest volume (n,) [-] of those simulated, J of water, det F of solids; read-only."""
        return self._solver.volume_ratio

    @property
    def pressure(self) -> npt.NDArray[np.float32]:
        """Pressure -tr(sigma) / D (n,) [Pa] of those simulated, above 0 in compression; read-only."""
        return self._solver.pressure

    def pressure_samples(self) -> PressureSamples:
        """Return the pressures of the n particles simulated."""
        spacing = self.scene.spacing / self.r_p ** (1 / self.dim)
        return PressureSamples(self.coarse_positions, self.pressure, float(spacing))

    def keep_forces(self) -> None:
        """Sum the forces on walls and obstacles in all later frames; see `Simulator.keep_forces`."""
        if self._sleep is not None:
            raise ConfigError(
                "forces need a solver without sleep: matter that sleeps does not press on walls and obstacles"
            )
        self._stepper.keep_forces()

    def frame_forces(self) -> npt.NDArray[np.float64]:
        """Return the forces on walls and obstacles in the latest frame; see `Simulator.frame_forces`."""
        if not self._stepper.keeps_forces:
            raise ConfigError(
                "no forces are kept: call keep_forces() before the frames whose forces are read, or read "
                "them with probes.record"
            )
        if self.last_frame is None or not len(self.last_frame.forces):
            solids = 2 * self.dim + len(self._scene.obstacles)
            return np.full((solids, 3 * (self.dim - 1)), np.nan)
        return self.last_frame.forces

    @property
    def rigid_bodies(self) -> RigidBodies:
        """The B rigid bodies of the scene as they are now; a snapshot, read-only."""
        return RigidBodies.of(self._solver.rigid, self.dim)

    def pull(
        self, body: int, grip: npt.ArrayLike, target: npt.ArrayLike, *, reach: float, strength: float
    ) -> None:
        """Pull at a rigid body in the next frame; see `Simulator.pull`."""
        self._stepper.pull(
            body=body,
            grip=np.asarray(grip).tolist(),
            target=np.asarray(target).tolist(),
            reach=reach,
            strength=strength,
        )

    def rigid_numbers(self) -> npt.NDArray[np.float64]:
        """Return the numbers (B, 13) of the rigid bodies; see `Simulator.rigid_numbers`."""
        return self._solver.rigid

    @property
    def rigid_energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of the rigid bodies [J], in 2D per metre of depth."""
        kinetic, potential = self._solver.rigid_energy
        return kinetic, potential

    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Whether each particle simulated (n,) sleeps; all False without a `Sleep`; read-only."""
        return self._solver.asleep

    @property
    def last_frame(self) -> _core.FrameReport | None:
        """Substeps of the latest frame; None before the first."""
        return self._stepper.last

    def diagnostics(self) -> _core.Diagnostics:
        """Mass, momentum, energies and extremes over the particles simulated, at this instant."""
        return self._solver.diagnostics()

    def torn_bodies(self) -> dict[int, float]:
        """Return the elastic bodies that have come apart, by index into `Scene.bodies`.

        The values are the shares of their particles in the largest piece [-]. Pieces are parted where no
        particles are nearer than 1.5 to 3 grid cells. A body that has lost less than 1 % counts as whole.
        """
        elastic = self._elastic_bodies()
        if not elastic:
            return {}
        # Emitters number their particles after those of the bodies.
        numbers = self._solver.ids.astype(np.int64)
        present = numbers < len(self._bodies)
        bodies = np.where(present, self._bodies[np.where(present, numbers, 0)], -1)
        mine = np.isin(bodies, elastic)
        dx = 1 / self.resolution
        torn = torn_bodies(self.coarse_positions[mine], bodies[mine], dx)
        if torn:
            # Obstacles and earlier bodies may part a body from the start.
            start = merge(self._scene.sample(), self._level.r_p)
            first = {body: largest_piece(start.x[start.body == body], dx) for body in torn}
            torn = {body: share for body, share in torn.items() if share < WHOLE * first[body]}
        return torn

    def _elastic_bodies(self) -> list[int]:
        return [i for i, body in enumerate(self._scene.bodies) if isinstance(body.material, Elastic)]

    def _advance(self, frames: int, force: CheckedForce, path: npt.NDArray[np.float32] | None) -> None:
        period = self.frame // _TEARING_PERIOD
        shows_all = self._upsampler is not None
        by_particle = force.array is not None and force.array.ndim > 1
        if force.by_frame or (shows_all and (by_particle or path is not None)):
            super()._advance(frames, force, path)
        elif shows_all:
            with signals.whole():
                self._update_shown()
                self._stepper.advance(frames, force.array)
        else:
            # The core computes all frames in one call.
            self._solver.advance(frames, force.array, path)
        self._warn(stacklevel=4)
        if self.frame // _TEARING_PERIOD != period and not self._warned.issuperset(
            f"torn {body}" for body in self._elastic_bodies()
        ):
            self._warn_of_tears(stacklevel=4)

    def _advance_coarse(self, force: npt.NDArray[np.float32] | None) -> None:
        self._stepper.advance(1, force)

    def prescribe(
        self,
        x: npt.ArrayLike,
        v: npt.ArrayLike,
        frame: int,
        *,
        affine: bool = True,
        deform: bool = False,
    ) -> _core.MotionReport:
        """Put the particles at given positions and velocities, e.g. a network's, at the end of a frame.

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
            else J, F and the like stay as they are. Errors of C add up while motion is prescribed: within 20
            frames the error of J of water is ten times its own variation.

        Raises
        ------
        NonFiniteError, DomainError, InvertedError
            Naming the particle. The state is then the one before.
        ConfigError
            Wrong shapes, or the solver has emitters, sinks, `sleep` or `show_all`.
        """
        if self._upsampler is not None:
            raise ConfigError(
                "prescribe is for solvers without show_all=True: the motion of the particles shown is unknown"
            )
        return self._solver.prescribe(
            float32("x", x, "(N, D)"),
            float32("v", v, "(N, D)"),
            whole("frame", frame, 0, 2**53),
            affine=affine,
            deform=deform,
        )

    def upsampler_for(self, coarse: CoarseParticles) -> Upsampler:
        """Return an upsampler from coarse particles, moved by another simulator, to all of the scene.

        Parameters
        ----------
        coarse : CoarseParticles
            Coarse particles at frame 0, which start as those of this solver.

        Raises
        ------
        ConfigError
            `r_p` is 1: there are no coarse particles.
        """
        return upsampler_of(self._scene, coarse, self._solver, self._level)

    def _warn(self, stacklevel: int) -> None:
        """Warn, each once, of a stopped emitter, a repeated frame and fast matter."""
        if self._scene.emitters and "full" in self.emitters:
            text = f"an emitter has stopped: the scene holds max_particles = {self._scene.max_particles}"
            self._warn_once("limit", ParticleLimitWarning, text, stacklevel)
        if self.redone_frames:
            text = (
                f"frame {self.redone_frames[0]} failed at the step of coarse level {self._level.name!r} and "
                "was done again at the safe step; `redone_frames` lists such frames. If there are many, the "
                "scene is outside of what the coarse level was fitted to: take a coarse level of more "
                "particles"
            )
            self._warn_once("redone", CoarseWarning, text, stacklevel)
        if self._stepper.too_fast is not None:
            text = (
                f"matter moves at {self._stepper.too_fast:.2g} m/s, but coarse level {self._level.name!r} "
                f"was fitted up to {self._level.fastest:.2g} m/s: its error may be larger than the table "
                "says; take a coarse level of more particles"
            )
            self._warn_once("speed", CoarseWarning, text, stacklevel)

    def _warn_of_tears(self, stacklevel: int) -> None:
        for body, share in self.torn_bodies().items():
            text = (
                f"bodies[{body}] has come apart by frame {self.frame}: its largest piece has {share:.0%} of "
                "it; make it stiffer, or lower the speeds"
            )
            self._warn_once(f"torn {body}", TornBodyWarning, text, stacklevel)

    def _warn_once(self, key: str, category: type[Warning], text: str, stacklevel: int) -> None:
        if key not in self._warned:
            self._warned |= {key}
            warnings.warn(text, category, stacklevel=stacklevel + 1)

    def snapshot(self) -> bytes:
        """Complete state, versioned and checksummed. Going on from it gives the same bits."""
        self._update_shown()
        return self._stepper.snapshot()

    def start_file(self) -> bytes:
        """Return settings and present state for a page that plays."""
        self._update_shown()
        return self._stepper.start()

    def restore(self, data: bytes) -> None:
        """Take the state of a snapshot of the same scene.

        Raises
        ------
        SnapshotError
            The bytes are damaged or of another scene; the present state is then untouched.
        """
        self._stepper.restore(data)

    def _arguments(self) -> dict[str, Any]:
        shown = {"r_p": self.r_p, "show_all": self._upsampler is not None}
        return {
            "substeps": self._substeps,
            "cfl": self._cfl,
            "allow_unstable": self._allow_unstable,
            "sleep": self._sleep,
            "threads": self._threads,
            **(shown if self.coarse is None else {"coarse": self.coarse}),
        }

    def _notes(self) -> dict[str, Any]:
        return {"warned": self._warned, **self._stepper.notes()}

    def _take_notes(self, notes: dict[str, Any]) -> None:
        self._warned = notes["warned"]
        self._stepper.take_notes(notes)

    def _settings_to_save(self) -> dict[str, Any]:
        settings = self._arguments()
        del settings["threads"]
        settings["sleep"] = None if self._sleep is None else self._sleep.model_dump()
        if self.coarse is not None:
            settings["coarse"] = self.coarse.to_dict()
        return settings

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
            sleep, level = settings.pop("sleep"), settings.pop("coarse", None)
            settings["sleep"] = None if sleep is None else Sleep.model_validate(sleep)
            settings["coarse"] = None if level is None else CoarseLevel.from_dict(level)
            return cls(saved.scene, **settings, threads=threads)

        return cls._restored(path, make)

    def copy(self) -> Self:
        """Return an independent solver in the same state."""
        twin = self._shallow()
        twin._stepper = self._stepper.copy()  # noqa: SLF001 - of this very class
        return twin

    def reset(self) -> None:
        """Go back to frame 0."""
        self.restore(self._start)


def _warnings_of(scene: Scene) -> Iterator[tuple[type[Warning], str]]:
    """Yield the warnings about a scene that do not depend on the solver."""
    for text in soft_materials(scene):
        yield SoftMaterialWarning, text
    if (rounded := rounded_up(scene.size, scene.resolution)) is not None:
        yield RoundedWorldWarning, rounded
    for text in scene.thin_obstacles():
        yield ThinObstacleWarning, text


def _refuse_beside_coarse(**given: bool) -> None:
    """Raise `ConfigError` for settings that a coarse level chooses."""
    for name, is_given in given.items():
        if is_given:
            raise ConfigError(f"{name} is chosen by the level: drop {name}, or give no coarse level")


def _checked(level: CoarseLevel, scene: Scene) -> CoarseLevel:
    """Return a coarse level of the caller's that fits a scene, or raise `ConfigError`."""
    if level.name is None:
        raise ConfigError("a coarse level needs a name, for messages and files: use level.named(...)")
    if len(level.moduli) != len(scene.materials):
        raise ConfigError(
            f"the coarse level {level.name!r} has {len(level.moduli)} moduli, but the scene has "
            f"{len(scene.materials)} material{'s' * (len(scene.materials) > 1)}: give one factor for each"
        )
    return level

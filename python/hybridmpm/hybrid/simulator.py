"""`HybridSimulator`: a network that goes ahead, guards that watch it, and MPM to fall back to."""

import copy
from collections.abc import Iterable, Sequence
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm._support.arguments import whole
from hybridmpm.downsampling.merge import checked_ratio
from hybridmpm.errors import ConfigError
from hybridmpm.hybrid.engine import Engine, Settings
from hybridmpm.hybrid.guard import Guard
from hybridmpm.hybrid.guards import DEFAULT, Cosine, Safeguard, build
from hybridmpm.hybrid.handoff import KINDS, Handoff
from hybridmpm.hybrid.log import Decision, Mode, frames_of_mpm, standing
from hybridmpm.hybrid.network import Network
from hybridmpm.mpm import MpmSolver
from hybridmpm.mpm.solver import MAX_FRAMES_AT_ONCE, acceleration
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Scene

MAX_WINDOW = 100
"""Longest window: the history kept holds two of this many accelerations."""

_Floats = npt.NDArray[np.float32]


class HybridSimulator:
    """A network simulates where its guards are content; else MPM does, with the same particles.

    MPM simulates the first 5 `r_t` frames, from which the network gets its history, every frame with an
    external force, and all frames from an alarm until the motion has been calm for a window of time. An alarm
    of a measure that tells late (`Guard.late`) undoes the network's latest steps, and MPM redoes these
    frames within the same call. A network that fails again is given a new chance after twice as many frames.

    Parameters
    ----------
    scene : Scene
        Without emitters, sinks and moving obstacles.
    physics : Stepper
        The network.
    r_c : float in [-1, 1]
        Alarming mean cosine between the accelerations of two windows of time.
    window : int in [1, 100]
        Steps of the network in each of the two windows, and those that have to be calm before it takes over.
    hysteresis : float in [0, 1]
        The motion is calm from r_c + hysteresis (1 - r_c) on.
    guards : sequence of str or Guard
        Names as in `hybrid.GUARDS`, or guards with other settings. Without any nothing is ever done about the
        network, and a state that cannot be raises an error.
    safeguard : "ours" or "paper"
        Which mean of the cosines; see `hybrid.Cosine`.
    handoff : "warm", "shadow" or "cold"
        What MPM takes over from the network besides positions and velocities; see docs/hybrid.md.
    threads : int in [1, 1024]
        Of MPM; the result does not depend on it.

    Raises
    ------
    ConfigError
        A setting is out of range, the network was not made for such a scene, or the scene cannot be simulated
        by a network.

    Notes
    -----
    N = round(r_p N_h) particles, in the order of `MpmSolver(scene, r_p=...)`. Between two steps of the
    network positions and velocities are interpolated. The same scene, network and calls give the same bits.
    """

    def __init__(
        self,
        scene: Scene,
        physics: Stepper,
        *,
        r_c: float = 0.8,
        window: int = 10,
        hysteresis: float = 0.25,
        guards: Sequence[str | Guard] = DEFAULT,
        safeguard: Safeguard = "ours",
        handoff: Handoff = "warm",
        threads: int = 1,
    ) -> None:
        _check_scene(scene)
        physics.check(scene)
        if handoff not in KINDS:
            raise ConfigError(f"handoff must be among {', '.join(KINDS)}; got {handoff!r}")
        self._cosine = Cosine(r_c, hysteresis, safeguard)
        self._guards = build(guards, self._cosine)
        self._settings = Settings(
            window=whole("window", window, 1, MAX_WINDOW), safeguard=safeguard, handoff=handoff
        )
        mpm = MpmSolver(scene, r_p=checked_ratio(physics.r_p), threads=threads)
        self._fresh = mpm.snapshot()
        self._network = Network(physics, scene, mpm.materials)
        self._engine = Engine(mpm, self._network, self._guards, self._settings)

    @property
    def scene(self) -> Scene:
        """The scene that this simulator was made from."""
        return self._engine.mpm.scene

    @property
    def physics(self) -> Stepper:
        """The network."""
        return self._network.physics

    @property
    def dim(self) -> int:
        """D, 2 or 3."""
        return self._engine.mpm.dim

    @property
    def resolution(self) -> int:
        """Grid cells per metre of MPM."""
        return self._engine.mpm.resolution

    @property
    def frame(self) -> int:
        """Frames done since the start."""
        return self._engine.frame

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self.frame * self.scene.frame_dt

    @property
    def particle_count(self) -> int:
        """N."""
        return self._engine.mpm.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) of the particles: 0, 1, ..."""
        return self._engine.mpm.ids

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,), read-only: 5 water, 6 sand, 7 elastic (goop)."""
        return self._engine.mpm.materials

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """(N,) [kg], read-only; in 2D of a slice one metre deep."""
        return self._engine.mpm.mass

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m]; a copy."""
        return self._engine.positions

    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m/s]; a copy."""
        return self._engine.velocities

    @property
    def mode(self) -> Mode:
        """Who simulates the next frame, if no force acts on it."""
        return self._engine.mode

    @property
    def safeguard(self) -> float | None:
        """Mean cosine between the accelerations of the last two windows; None until both are full."""
        return self._engine.value

    @property
    def r_c(self) -> float:
        """Below this `safeguard` is alarming."""
        return self._cosine.r_c

    @property
    def log(self) -> tuple[Decision, ...]:
        """All decisions so far, in the order in which they were made."""
        return tuple(self._engine.log)

    @property
    def mpm_share(self) -> float:
        """Share of the frames so far that MPM simulated, those redone counted once; 1 before the first."""
        return frames_of_mpm(self._engine.log, self.frame) / self.frame if self.frame else 1.0

    @property
    def last_frame(self) -> _native.FrameReport | None:
        """How MPM cut its latest frame; None where the network made the present state."""
        return self._engine.mpm.last_frame

    def diagnostics(self) -> _native.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant."""
        mpm = self._engine.mpm
        if self._engine.is_between:
            mpm = mpm.copy()
            mpm.prescribe(self.positions, self.velocities, self.frame)
        return mpm.diagnostics()

    def advance(self, frames: int = 1, force: npt.ArrayLike | None = None) -> None:
        """Go on by whole frames.

        Parameters
        ----------
        frames : int in [0, 1000000]
        force : (N, D) or (frames, N, D), optional
            External acceleration [m/s^2] besides gravity, held over the call or given per frame. Frames in
            which it is not zero everywhere are simulated by MPM.

        Raises
        ------
        NonFiniteError, DomainError, InvertedError, StepSizeError
            MPM failed, or the network where no guard watches it. The state is then the one before the frame.
        ConfigError
            `frames` out of range or `force` of a wrong shape; nothing has moved.
        """
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        forces = self._checked(force, frames)
        for index in range(frames):
            now = forces if forces is None or forces.ndim == 2 else forces[index]
            self._engine.advance_frame(now if now is not None and now.any() else None)

    def rollout(self, frames: int, force: npt.ArrayLike | None = None) -> npt.NDArray[np.float32]:
        """Advance, and return where the particles were on the way, as they were shown.

        Parameters and errors are those of `advance`.

        Returns
        -------
        float32 (frames + 1, N, D)
            Positions [m]; the first row is the state before the call. Frames that were undone later stay as
            they were when their turn came.
        """
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        forces = self._checked(force, frames)
        path = np.empty((frames + 1, self.particle_count, self.dim), dtype=np.float32)
        path[0] = self.positions
        for index in range(frames):
            self.advance(1, forces if forces is None or forces.ndim == 2 else forces[index])
            path[index + 1] = self.positions
        return path

    def replay(self, log: Iterable[Decision], frames: int, force: npt.ArrayLike | None = None) -> None:
        """Start again and advance as a log says, whatever the guards would; the result has the same bits.

        What the log says of the last frame is done too: where MPM takes over there, it has.

        Parameters
        ----------
        log : iterable of Decision
            Of a simulator of the same scene and network, with the same handoff.
        frames : int in [0, 1000000]
        force : (N, D) or (frames, N, D), optional
            That of the logged run.

        Raises
        ------
        ConfigError
            The log lets the network begin where it cannot; otherwise as `advance`.
        """
        script = standing(log)
        for decision in script:
            if decision.mode == "neural" and decision.frame % self._network.r_t:
                raise ConfigError(
                    f"the log lets the network begin at frame {decision.frame}, which must be a multiple of "
                    f"its r_t = {self._network.r_t}"
                )
        self.reset()
        self._engine.script = script
        try:
            self.advance(frames, force)
            self._engine.left_by_script()
        finally:
            self._engine.script = None

    def reset(self) -> None:
        """Go back to frame 0."""
        mpm = self._engine.mpm
        mpm.restore(self._fresh)
        self._engine = Engine(mpm, self._network, self._guards, self._settings)

    def copy(self) -> Self:
        """Return an independent simulator in the same state, with the same network."""
        twin = copy.copy(self)
        twin._engine = self._engine.copy()  # noqa: SLF001 - of this very class
        return twin

    def _checked(self, force: npt.ArrayLike | None, frames: int) -> _Floats | None:
        forces = acceleration("force", force)
        if forces is not None:
            held = (self.particle_count, self.dim)
            if forces.shape not in (held, (frames, *held)):
                raise ConfigError(f"force must be of shape {held} or {(frames, *held)}, got {forces.shape}")
            if not np.isfinite(forces).all():
                raise ConfigError("force must be finite")
        return forces


def _check_scene(scene: Scene) -> None:
    """Refuse what a network on a fixed set of particles cannot simulate."""
    if scene.is_open:
        raise ConfigError(
            "a network needs a fixed number of particles: remove emitters and sinks, or use MpmSolver"
        )
    if any(obstacle.motion is not None for obstacle in scene.obstacles):
        raise ConfigError(
            "a network takes obstacles for particles at rest: remove `motion`, or use MpmSolver"
        )

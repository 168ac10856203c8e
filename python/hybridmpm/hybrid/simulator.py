"""`HybridSimulator`: a network that goes ahead, guards that watch it, and MPM to fall back to."""

import copy
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.arguments import whole
from hybridmpm.data.kinematic import kinematic_particles
from hybridmpm.data.particle_types import KINEMATIC
from hybridmpm.downsampling import checked_ratio
from hybridmpm.errors import ConfigError, NonFiniteError, SimulationError
from hybridmpm.hybrid import handoff as handoffs
from hybridmpm.hybrid.guards import DEFAULT, Cosine, Guard, Safeguard, Stage, View, build
from hybridmpm.hybrid.log import Decision, Mode, frames_of_mpm, standing
from hybridmpm.hybrid.stepper import Stepper
from hybridmpm.mpm import MAX_FRAMES_AT_ONCE, MpmSolver, acceleration
from hybridmpm.scene import Scene

MAX_WINDOW = 100
"""Longest window: the history kept holds two of this many accelerations."""
NOISE_FLOOR = 0.05 * 9.81
"""A particle is calm whose root mean square acceleration is below this [m/s^2]."""
QUORUM = 0.02
"""With a smaller share of particles that are not calm the scene is calm."""

_CHECKPOINTS = 4
_MAX_DOUBLINGS = 6

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True)
class _Step:
    """A step of the network under way, from one state to the next, `r_t` frames later."""

    x: tuple[_Floats, _Floats]
    v: tuple[_Floats, _Floats]


@dataclass(frozen=True)
class _Checkpoint:
    """A state to go back to."""

    frame: int
    steps: int
    mpm: bytes
    path: tuple[_Floats, ...]
    history: _native.AccelerationHistory
    guards: tuple[Guard, ...]
    value: float | None


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
        handoff: handoffs.Handoff = "warm",
        threads: int = 1,
    ) -> None:
        _check_scene(scene)
        physics.check(scene)
        self._physics = physics
        self._r_t = whole("r_t of the network", physics.r_t, 1, 100)
        self._window = whole("window", window, 1, MAX_WINDOW)
        if handoff not in handoffs.KINDS:
            raise ConfigError(f"handoff must be among {', '.join(handoffs.KINDS)}; got {handoff!r}")
        self._handoff: handoffs.Handoff = handoff
        self._cosine = Cosine(r_c, hysteresis, safeguard)
        self._fresh_guards = build(guards, self._cosine)
        self._mpm = MpmSolver(scene, r_p=checked_ratio(physics.r_p), threads=threads)
        self._fresh = self._mpm.snapshot()
        self._dt = self._r_t * scene.frame_dt
        spacing = scene.spacing * checked_ratio(physics.r_p) ** (-1 / scene.dim)
        self._solids = kinematic_particles(scene, spacing)
        types = self._mpm.materials.astype(np.int64)
        self._network_types = np.concatenate([types, np.full(len(self._solids), KINEMATIC)])
        self._walls = np.array([scene.walls.lower, scene.walls.upper], dtype=np.float32)
        self._script: list[Decision] | None = None
        self.reset()

    @property
    def scene(self) -> Scene:
        """The scene that this simulator was made from."""
        return self._mpm.scene

    @property
    def physics(self) -> Stepper:
        """The network."""
        return self._physics

    @property
    def dim(self) -> int:
        """D, 2 or 3."""
        return self._mpm.dim

    @property
    def resolution(self) -> int:
        """Grid cells per metre of MPM."""
        return self._mpm.resolution

    @property
    def frame(self) -> int:
        """Frames done since the start."""
        return self._frame

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self._frame * self.scene.frame_dt

    @property
    def particle_count(self) -> int:
        """N."""
        return self._mpm.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) of the particles: 0, 1, ..."""
        return self._mpm.ids

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,), read-only: 5 water, 6 sand, 7 elastic (goop)."""
        return self._mpm.materials

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """(N,) [kg], read-only; in 2D of a slice one metre deep."""
        return self._mpm.mass

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m]; a copy."""
        return self._mpm.positions if self._step is None else self._between(self._step.x)

    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m/s]; a copy."""
        return self._mpm.velocities if self._step is None else self._between(self._step.v)

    @property
    def mode(self) -> Mode:
        """Who simulates the next frame, if no force acts on it."""
        return self._mode

    @property
    def safeguard(self) -> float | None:
        """Mean cosine between the accelerations of the last two windows; None until both are full."""
        return self._value

    @property
    def r_c(self) -> float:
        """Below this `safeguard` is alarming."""
        return self._cosine.r_c

    @property
    def log(self) -> tuple[Decision, ...]:
        """All decisions so far, in the order in which they were made."""
        return tuple(self._log)

    @property
    def mpm_share(self) -> float:
        """Share of the frames so far that MPM simulated, those redone counted once; 1 before the first."""
        return frames_of_mpm(self._log, self._frame) / self._frame if self._frame else 1.0

    @property
    def last_frame(self) -> _native.FrameReport | None:
        """How MPM cut its latest frame; None where the network made the present state."""
        return self._mpm.last_frame

    def diagnostics(self) -> _native.Diagnostics:
        """Mass, momentum, energies and extremes over all particles, at this instant."""
        if self._step is None:
            return self._mpm.diagnostics()
        twin = self._mpm.copy()
        twin.prescribe(self.positions, self.velocities, self._frame)
        return twin.diagnostics()

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
            self._advance_frame(now if now is not None and now.any() else None)

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
            if decision.mode == "neural" and decision.frame % self._r_t:
                raise ConfigError(
                    f"the log lets the network begin at frame {decision.frame}, which must be a multiple of "
                    f"its r_t = {self._r_t}"
                )
        self.reset()
        self._script = script
        try:
            self.advance(frames, force)
        finally:
            self._script = None

    def reset(self) -> None:
        """Go back to frame 0."""
        self._mpm.restore(self._fresh)
        self._frame = 0
        self._mode: Mode = "mpm"
        self._step: _Step | None = None
        self._steps = 0
        self._value: float | None = None
        self._guards = tuple(guard.copy() for guard in self._fresh_guards)
        self._log: list[Decision] = []
        self._path: deque[_Floats] = deque([self._mpm.positions], maxlen=self._physics.HISTORY)
        self._history = _native.AccelerationHistory(
            self.particle_count,
            self.dim,
            window=self._window,
            dt=self._dt,
            floor=NOISE_FLOOR,
            quorum=QUORUM,
        )
        self._history.push(self._path[0])
        self._checkpoints: deque[_Checkpoint] = deque(maxlen=_CHECKPOINTS)
        self._quiet = self._patience = self._failures = 0
        self._is_redoing = False

    def copy(self) -> Self:
        """Return an independent simulator in the same state, with the same network."""
        twin = copy.copy(self)
        twin._mpm = self._mpm.copy()  # noqa: SLF001 - of this very class
        twin._history = self._history.copy()  # noqa: SLF001
        twin._guards = tuple(guard.copy() for guard in self._guards)  # noqa: SLF001
        twin._log = list(self._log)  # noqa: SLF001
        twin._path = self._path.copy()  # noqa: SLF001
        twin._checkpoints = self._checkpoints.copy()  # noqa: SLF001
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

    def _between(self, ends: tuple[_Floats, _Floats]) -> _Floats:
        """Interpolate between the ends of the step under way."""
        share = np.float32((self._frame % self._r_t) / self._r_t)
        return np.asarray(ends[0] + share * (ends[1] - ends[0]), dtype=np.float32)

    def _advance_frame(self, force: _Floats | None) -> None:
        if force is not None and self._mode == "neural":
            self._interrupt()
        if self._mode == "neural" and self._step is None:
            self._begin_step()
        if self._mode == "mpm":
            self._advance_mpm(force)
            return
        self._frame += 1
        if self._frame % self._r_t == 0:
            self._end_step()

    # MPM simulates.

    def _advance_mpm(self, force: _Floats | None = None) -> None:
        try:
            self._mpm.advance(1, force)
        except SimulationError:
            # What MPM cannot go on from, shortly after it took over, is the network's doing.
            if not self._checkpoints or force is not None:
                raise
            self._roll_back("unsound", None)
            self._mpm.advance(1)
        self._frame += 1
        if self._checkpoints and (
            force is not None or self._frame - self._log[-1].noticed > self._window * self._r_t
        ):
            self._checkpoints.clear()
        if self._frame % self._r_t:
            return
        x = self._mpm.positions
        self._path.append(x)
        signal = self._history.push(x)
        self._value = self._read(signal)
        view = View(x=x, mpm=self._mpm, r_t=self._r_t, steps=0, signal=signal)
        values = [(guard, guard.value(view)) for guard in self._guards if guard.stage is Stage.MOTION]
        calm = force is None and all(value is None or guard.is_quiet(value) for guard, value in values)
        self._quiet = self._quiet + 1 if calm else 0
        if self._may_enter(is_forced=force is not None):
            self._enter()

    def _read(self, signal: _native.AccelerationSignal) -> float | None:
        return signal.cosine if self._cosine.safeguard == "ours" else signal.plain

    def _may_enter(self, *, is_forced: bool) -> bool:
        if len(self._path) < self._physics.HISTORY or self._is_redoing:
            return False
        if self._script is not None:
            decision = self._scripted()
            return decision is not None and decision.mode == "neural"
        return self._quiet >= self._patience and not is_forced

    def _scripted(self) -> Decision | None:
        """Return the decision that holds at the present frame, by the log that is replayed."""
        held = [decision for decision in self._script or () if decision.frame <= self._frame]
        return held[-1] if held else None

    def _enter(self) -> None:
        self._decide("neural", "calm" if self._log else "warm-up", self._value)
        self._steps = 0
        self._checkpoints.clear()
        self._keep()
        if self._script is None and any(guard.stage is Stage.STATE for guard in self._guards):
            report = self._mpm.copy().prescribe(self._mpm.positions, self._mpm.velocities, self._frame)
            for guard in self._guards:
                guard.begin(report)

    # The network simulates.

    def _begin_step(self) -> None:
        """Ask the network for a step, or leave it to MPM."""
        decision = self._scripted()
        if decision is not None and decision.mode == "mpm":
            self._leave(decision.reason, decision.value, noticed=decision.noticed)
            return
        x = self._asked()
        if self._is_alarmed(Stage.RAW, x):
            return
        if not np.isfinite(x).all():
            worst = int(np.argmin(np.isfinite(x).all(axis=1)))
            raise NonFiniteError(
                f"the network's answer for particle {worst} is not finite in frame {self._frame}: "
                "let the guard 'non-finite' watch it"
            )
        x = np.clip(x, self._walls[0], self._walls[1])
        signal = self._history.push(x)
        if self._is_alarmed(Stage.MOTION, x, signal=signal):
            return
        self._value = self._read(signal)
        latest = self._path[-1]
        v = handoffs.velocity([self._path[-2], latest, x], -1, self._dt)
        self._step = _Step(x=(latest, x), v=(self._mpm.velocities, v))

    def _asked(self) -> _Floats:
        """Return the network's positions (N, D) after its next step."""
        states = np.stack(self._path)
        solids = np.broadcast_to(self._solids, (len(states), *self._solids.shape))
        history = np.ascontiguousarray(np.concatenate([states, solids], axis=1))
        known = np.tile(np.array(self.scene.gravity, dtype=np.float32), (history.shape[1], 1))
        x = np.asarray(self._physics.step(history, self._network_types, known, self._walls), dtype=np.float32)
        if x.shape != history.shape[1:]:
            raise ConfigError(f"the network must answer positions {history.shape[1:]}, got {x.shape}")
        return x[: self.particle_count]

    def _end_step(self) -> None:
        """Arrive where the network's step leads, and look whether that state is sound."""
        step, self._step = self._step, None
        assert step is not None  # noqa: S101 - a step ends where one began
        try:
            report = self._mpm.prescribe(step.x[1], step.v[1], self._frame, deform=self._handoff == "shadow")
        except SimulationError:
            if not self._guards:
                self._frame, self._step = self._frame - 1, step
                raise
            self._roll_back("unsound", None)
            return
        x = self._mpm.positions
        self._path.append(x)
        self._steps += 1
        if self._is_alarmed(Stage.STATE, x, report=report):
            return
        if self._steps % (2 * self._window) == 0:
            self._keep()

    def _is_alarmed(
        self,
        stage: Stage,
        x: _Floats,
        *,
        signal: _native.AccelerationSignal | None = None,
        report: _native.MotionReport | None = None,
    ) -> bool:
        """Ask the guards of a stage; at the first alarm let MPM take over."""
        if self._script is not None:
            return False
        steps = self._steps + (stage is not Stage.STATE)
        view = View(x=x, mpm=self._mpm, r_t=self._r_t, steps=steps, signal=signal, report=report)
        for guard in self._guards:
            if guard.stage is not stage:
                continue
            value = guard.value(view)
            if value is None or not guard.alarms(value):
                continue
            if stage is Stage.MOTION:
                self._history.undo()
            self._count_failure(is_fault=guard.is_fault)
            if guard.late:
                self._roll_back(guard.name, value)
            else:
                self._leave(guard.name, value)
            return True
        return False

    # From one to the other.

    def _count_failure(self, *, is_fault: bool) -> None:
        """Set how long the motion has to be calm before the network gets another chance.

        A network that does not last for a window counts as one that erred, whoever noticed.
        """
        if is_fault or self._steps < self._window:
            self._failures = min(self._failures + 1, _MAX_DOUBLINGS)
        elif self._steps >= 4 * self._window:
            self._failures = 0
        self._patience = self._window * 2**self._failures

    def _keep(self) -> None:
        self._checkpoints.append(
            _Checkpoint(
                frame=self._frame,
                steps=self._steps,
                mpm=self._mpm.snapshot(),
                path=tuple(self._path),
                history=self._history.copy(),
                guards=tuple(guard.copy() for guard in self._guards),
                value=self._value,
            )
        )

    def _roll_back(self, reason: str, value: float | None) -> None:
        """Go back to a state before the failure, and let MPM redo the frames since."""
        noticed = self._frame
        while len(self._checkpoints) > 1 and self._steps - self._checkpoints[-1].steps < self._window // 2:
            self._checkpoints.pop()
        back = self._checkpoints.pop()
        self._mpm.restore(back.mpm)
        self._frame, self._steps, self._value, self._step = back.frame, back.steps, back.value, None
        self._path.clear()
        self._path.extend(back.path)
        self._history = back.history.copy()
        self._guards = tuple(guard.copy() for guard in back.guards)
        self._leave(reason, value, noticed=noticed)
        self._is_redoing = True
        try:
            while self._frame < noticed:
                self._advance_mpm()
        finally:
            self._is_redoing = False

    def _leave(self, reason: str, value: float | None, *, noticed: int | None = None) -> bool:
        """Let MPM go on from the present state; false where it had to go on from an earlier one."""
        if self._steps and not self._is_handed_over(reason, value):
            return False
        self._decide("mpm", reason, value, noticed)
        self._steps = self._quiet = 0
        return True

    def _is_handed_over(self, reason: str, value: float | None) -> bool:
        """Bring MPM into a state that fits the network's; where it cannot follow, go back further."""
        if self._handoff == "shadow":
            return True
        if self._handoff == "cold":
            handoffs.cold(self._mpm, self._fresh)
            return True
        steps = min(handoffs.STEPS, self._steps)
        first = self._checkpoints[0] if self._checkpoints else None
        start = first.mpm if first is not None and first.steps == 0 and steps == self._steps else None
        try:
            handoffs.warm(self._mpm, self._path, r_t=self._r_t, start=start, steps=steps)
        except SimulationError:
            if not self._checkpoints:
                raise
            self._roll_back(reason, value)
            return False
        return True

    def _interrupt(self) -> None:
        """Let MPM go on from the present state because a force acts, be it amid a step of the network."""
        step, x, v = self._step, self.positions, self.velocities
        self._patience = self._window * 2**self._failures
        if step is not None:
            self._step = None
            self._history.undo()
        if self._leave("force", self._value) and step is not None:
            self._mpm.advance(self._frame % self._r_t)
            self._mpm.prescribe(x, v, self._frame)

    def _decide(self, mode: Mode, reason: str, value: float | None, noticed: int | None = None) -> None:
        self._mode = mode
        self._log.append(
            Decision(
                frame=self._frame,
                mode=mode,
                value=value,
                reason=reason,
                noticed=self._frame if noticed is None else noticed,
            )
        )


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

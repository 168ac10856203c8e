"""`HybridLoop`: the frame loop of the hybrid simulator, and the ways from the network to MPM and back."""

import contextlib
import copy
import functools
from collections.abc import Iterator
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.coarse.merging import spacing_at
from hybridmpm.decisions import Decision, Mode, StepSource
from hybridmpm.errors import ConfigError, NonFiniteError, SimulationError
from hybridmpm.hybrid import handoff
from hybridmpm.hybrid.guard import Guard, GuardInput, Stage
from hybridmpm.hybrid.shortcuts import Shortcuts
from hybridmpm.hybrid.state import Backoff, Checkpoint, HybridState, NetworkState
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track

NOISE_FLOOR = 0.05 * 9.81
"""Root mean square acceleration [m/s^2] below which a particle is calm."""
MIN_ACTIVE_SHARE = 0.02
"""Share of particles that are not calm below which the whole scene is calm."""
_UNDONE_WITH_FAILURE = 2
"""Steps that are undone with one in which the network failed: particles clump before it does."""

_Floats = npt.NDArray[np.float32]


class HybridLoop:
    """A hybrid simulation without checks of arguments.

    Parameters
    ----------
    mpm : MpmSolver
        Solver at frame 0; the loop's own from now on.
    stepper : Stepper
        The network.
    guards : tuple of Guard
        Guards that watch the network, in the order of their stages.
    window : int
        Network steps in each of the two windows of time that accelerations are compared over.
    wait : int
        Calm MPM steps before the network resumes after its first failure.
    shortcuts : bool
        Compute free fall and rest without the network.
    show_all : bool
        Show all particles of the scene.
    """

    def __init__(
        self,
        mpm: MpmSolver,
        stepper: Stepper,
        guards: tuple[Guard, ...],
        *,
        window: int,
        wait: int,
        shortcuts: bool,
        show_all: bool,
    ) -> None:
        self._stepper, self._fresh_guards = stepper, guards
        self._window, self._wait, self._show_all = window, wait, show_all
        self._shortcuts = Shortcuts(spacing_at(mpm.scene, mpm.r_p)) if shortcuts else None
        self._fresh = mpm.snapshot()
        self.state = self._first_state(mpm)

    def _first_state(self, mpm: MpmSolver) -> HybridState:
        track = Track(self._stepper, mpm.scene, mpm.materials)
        history = _core.AccelerationHistory(
            mpm.particle_count,
            mpm.dim,
            window=self._window,
            dt=track.step_dt,
            calm_acceleration=NOISE_FLOOR,
            min_active_share=MIN_ACTIVE_SHARE,
        )
        x = mpm.positions
        track.observe(x)
        history.push(x)
        network = NetworkState(track, history, tuple(guard.copy() for guard in self._fresh_guards))
        upsampler = mpm.upsampler_for(self) if self._show_all else None
        return HybridState(mpm, network, Backoff(self._wait), upsampler)

    def reset(self) -> None:
        """Go back to frame 0."""
        self.state.mpm.restore(self._fresh)
        self.state = self._first_state(self.state.mpm)

    def copy(self) -> Self:
        """Return an independent loop in the same state, with the same network."""
        twin = copy.copy(self)
        twin.state = self.state.copy(twin)
        return twin

    @property
    def is_between(self) -> bool:
        """Whether a step of the network is under way."""
        return self._network.track.is_under_way

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._network.frame

    @property
    def particle_count(self) -> int:
        """Number n of particles."""
        return self.state.mpm.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (n,) of the particles: 0, 1, ..."""
        return self.state.mpm.ids

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (n,) into the scene's materials."""
        return self.state.mpm.material

    @property
    def mass(self) -> _Floats:
        """Masses (n,) [kg]."""
        return self.state.mpm.mass

    @property
    def affine(self) -> _Floats:
        """Velocity gradients (n, D, D) [1/s]; within a step of the network those at its beginning."""
        return self.state.mpm.affine

    @property
    def positions(self) -> _Floats:
        """Positions (n, D) [m]; a copy."""
        track = self._network.track
        return track.positions.copy() if track.is_under_way else self.state.mpm.positions

    @property
    def velocities(self) -> _Floats:
        """Velocities (n, D) [m/s]; a copy."""
        track, ends = self._network.track, self._network.end_velocities
        if not track.is_under_way or ends is None:
            return self.state.mpm.velocities
        begin, end = ends
        return np.asarray(begin + np.float32(track.phase / track.r_t) * (end - begin))

    @property
    def _network(self) -> NetworkState:
        return self.state.network

    @property
    def _r_t(self) -> int:
        return self._network.track.r_t

    def advance_frame(self, force: _Floats | None) -> None:
        """Advance by one frame, under a force (D,) or (n, D) [m/s^2] that is not zero everywhere, or None."""
        if force is not None and self.state.mode == "neural":
            with self._all_or_nothing():
                self._interrupt()
                self._advance_mpm(force)
            return
        if self.state.mode == "neural" and not self.is_between and not self._begin_step():
            return
        if self.state.mode == "mpm":
            self._advance_mpm(force)
            return
        if (self._network.frame + 1) % self._r_t == 0:
            self._end_step()
        else:
            self._network.tick()
            self._network.track.tick()

    # MPM simulates.

    def _advance_mpm(self, force: _Floats | None) -> None:
        try:
            self.state.mpm.advance(1, force)
        except SimulationError:
            # MPM fails shortly after it took over because of the state that the network left.
            if not self.state.can_go_back or force is not None:
                raise
            with self._all_or_nothing():
                self._advance_from_earlier()
        self._after_mpm(is_forced=force is not None)
        reason = self._entry(is_forced=force is not None)
        if reason is not None:
            self._decide("neural", reason, self._network.safeguard)
            # MPM may fail some frames later only, because of a state that the network left.
            self.state.begin_with_present(self._network.frame - 4 * self._window * self._r_t)

    def _advance_from_earlier(self) -> None:
        """Go back as far as needed for MPM to simulate the next frame."""
        while True:
            self.state.backoff.restart(is_fault=True)
            self._roll_back("unsound", None)
            try:
                self.state.mpm.advance(1)
            except SimulationError:
                if not self.state.can_go_back:
                    raise
            else:
                return

    def _after_mpm(self, *, is_forced: bool) -> None:
        """Take a frame of MPM into the history, and count calm steps."""
        state, network = self.state, self._network
        network.frame += 1
        if state.can_go_back and (
            is_forced or network.frame - state.log[-1].noticed > self._window * self._r_t
        ):
            state.forget()
        if network.frame % self._r_t:
            return
        x = state.mpm.positions
        network.track.observe(x)
        signal = network.history.push(x)
        network.safeguard = signal.cosine
        given = GuardInput(x=x, mpm=state.mpm, r_t=self._r_t, steps=0, signal=signal)
        values = [(guard, guard.value(given)) for guard in network.guards if guard.stage is Stage.MOTION]
        calm = not is_forced and all(value is None or guard.is_quiet(value) for guard, value in values)
        state.backoff.count(is_calm=calm)

    def _entry(self, *, is_forced: bool) -> str | None:
        """Return for what reason the network takes over at this frame, None where it does not."""
        if is_forced or self._network.frame % self._r_t or not self._network.track.ready:
            return None
        if self.state.backoff.is_over:
            return "calm" if self.state.log else "warm-up"
        shortcut = self._shortcut()
        return None if shortcut is None else shortcut[1]

    def _shortcut(self) -> tuple[_Floats, StepSource] | None:
        """Return the next step by free fall or rest, and which of them; None where neither applies."""
        return None if self._shortcuts is None else self._shortcuts.step(self._network.track)

    # The network simulates.

    def _begin_step(self) -> bool:
        """Begin a step of the network; False where MPM has taken over and made the frame instead."""
        shortcut = self._shortcut()
        if shortcut is not None:
            self._begin(*shortcut, self._network.history.push(shortcut[0]))
            return True
        before = self._network.copy()
        try:
            x = self._evaluate()
            return x is not None and self._is_accepted(x)
        except BaseException:
            self.state.network = before  # guards change where they are evaluated
            raise

    def _evaluate(self) -> _Floats | None:
        """Return where the network's step leads (n, D) [m]; None where MPM has made the frame instead."""
        network, track = self._network, self._network.track
        try:
            x = track.predict()
        except Exception as error:
            # A ConfigError is a mistake of the caller, which MPM cannot make good.
            if not network.guards or isinstance(error, ConfigError):
                raise
            with self._all_or_nothing():
                made = network.network_steps
                self.state.backoff.restart(steps=made, is_fault=True)
                self._roll_back("unsound", None, steps=network.steps - min(_UNDONE_WITH_FAILURE, made))
                self._advance_mpm(None)
            return None
        alarm = self._alarm(Stage.RAW, x)
        if alarm is not None:
            self._refuse(*alarm)
            return None
        if not np.isfinite(x).all():
            worst = int(np.argmin(np.isfinite(x).all(axis=1)))
            raise NonFiniteError(
                f"the network's answer for particle {worst} is not finite in frame {network.frame}: "
                "let the guard 'non-finite' watch it"
            )
        x = np.clip(x, *track.walls)
        if self._shortcuts is not None:
            resting = self._shortcuts.resting(track)
            x[resting] = track.states[-1][resting]
        return x

    def _is_accepted(self, x: _Floats) -> bool:
        """Begin the step that leads to x; False where guards refuse it and MPM has made the frame instead."""
        network = self._network
        if network.network_steps == 0:
            mpm = self.state.mpm
            report = mpm.copy().prescribe(mpm.positions, mpm.velocities, network.frame)
            for guard in network.guards:
                guard.begin(report)
        signal = network.history.push(x)
        alarm = self._alarm(Stage.MOTION, x, signal=signal)
        if alarm is not None:
            network.history.undo()
            self._refuse(*alarm)
            return False
        self._begin(x, "network", signal)
        return True

    def _begin(self, x: _Floats, source: StepSource, signal: _core.AccelerationSignal) -> None:
        """Begin a step that leads to x (n, D) [m]."""
        network = self._network
        network.source = source
        network.safeguard = signal.cosine
        latest = network.track.states
        end = handoff.velocity([latest[-2], latest[-1], x], -1, network.track.step_dt)
        if source == "rest":
            end = np.zeros_like(end)
        network.end_velocities = (self.state.mpm.velocities, end)
        network.track.begin(x)

    def _end_step(self) -> None:
        """Arrive where the network's step leads, and check that state."""
        network, mpm = self._network, self.state.mpm
        assert network.end_velocities is not None  # noqa: S101 - a step ends where one began
        before = self.state.checkpoint()
        network.tick()
        try:
            report = mpm.prescribe(network.track.end, network.end_velocities[1], network.frame)
        except SimulationError:
            if not network.guards:
                network.frame, network.counts = before.network.frame, before.network.counts
                raise
            with self._all_or_nothing(before):
                self.state.backoff.restart(steps=network.network_steps, is_fault=True)
                self._roll_back("unsound", None)
            return
        x = mpm.positions
        network.track.observe(x)
        network.steps += 1
        network.network_steps = network.network_steps + 1 if network.source == "network" else 0
        made = network.network_steps
        try:
            alarm = self._alarm(Stage.STATE, x, report=report) if made else None
        except BaseException:
            self.state.take_back(before)
            raise
        if alarm is not None:
            guard, value = alarm
            with self._all_or_nothing(before):
                self.state.backoff.restart(steps=made, is_fault=guard.is_fault)
                self._roll_back(guard.name, value, steps=network.steps - 1 - min(guard.undo, made - 1))
            return
        self.state.keep()

    def _alarm(
        self,
        stage: Stage,
        x: _Floats,
        *,
        signal: _core.AccelerationSignal | None = None,
        report: _core.MotionReport | None = None,
    ) -> tuple[Guard, float] | None:
        """Evaluate the guards of a stage; return the first that alarms, with its value."""
        given = GuardInput(
            x=x,
            mpm=self.state.mpm,
            r_t=self._r_t,
            steps=self._network.network_steps + (stage is not Stage.STATE),
            signal=signal,
            report=report,
            mpm_step=functools.cache(self._mpm_step),
        )
        for guard in self._network.guards:
            value = guard.value(given) if guard.stage is stage else None
            if value is not None and guard.alarms(value):
                return guard, value
        return None

    def _mpm_step(self) -> _Floats | None:
        """Return where MPM leads in a step from the present state, (n, D) [m]; None where it fails."""
        twin = self.state.mpm.copy()
        try:
            self._warm_up(twin)
            twin.advance(self._r_t)
        except SimulationError:
            return None
        return twin.positions

    # From one to the other.

    @contextlib.contextmanager
    def _all_or_nothing(self, before: Checkpoint | None = None) -> Iterator[None]:
        """Put everything back as it was before the frame if MPM cannot take over.

        `before` is the state before the frame, where that is no longer the present one.
        """
        kept = self.state.copy()
        try:
            yield
        except BaseException:
            self.state = kept
            if before is not None:
                kept.take_back(before)
            raise

    def _refuse(self, guard: Guard, value: float) -> None:
        """Let MPM take over because of an alarm about a step that has not started, and compute the frame."""
        network = self._network
        with self._all_or_nothing():
            made = network.network_steps
            self.state.backoff.restart(steps=made, is_fault=guard.is_fault)
            undone = min(guard.undo, made)
            if undone:
                self._roll_back(guard.name, value, steps=network.steps - undone)
            else:
                self._leave(guard.name, value)
            self._advance_mpm(None)

    def _interrupt(self) -> None:
        """Let MPM go on from the present state because a force acts, be it within a step of the network."""
        network, x, v = self._network, self.positions, self.velocities
        is_between, phase = self.is_between, network.track.phase
        self.state.backoff.restart()
        if is_between:
            network.track.drop()
            network.history.undo()
        if self._leave("force", network.safeguard) and is_between:
            self.state.mpm.advance(phase)
            self.state.mpm.prescribe(x, v, network.frame)

    def _leave(self, reason: str, value: float | None) -> bool:
        """Let MPM go on from the present state; False where it had to go on from an earlier one."""
        try:
            self._warm_up(self.state.mpm)
        except SimulationError:
            if not self.state.can_go_back:
                raise
            self._roll_back(reason, value)
            return False
        self._decide("mpm", reason, value)
        return True

    def _roll_back(self, reason: str, value: float | None, *, steps: int | None = None) -> None:
        """Go back to a state before the failure, and let MPM redo the frames since.

        The state is where the network had made `steps` steps, or fewer where no such state is kept; the
        latest where `steps` is None. Where MPM cannot go on from there, earlier ones are tried.
        """
        state, noticed = self.state, self._network.frame
        while True:
            while (
                len(state.checkpoints) > 1
                and steps is not None
                and state.checkpoints[-1].network.steps > steps
            ):
                state.checkpoints.pop()
            state.go_back()
            if state.upsampler is not None:
                # Checkpoints are taken before the upsampler has followed to their frame.
                state.upsampler.update()
            try:
                self._warm_up(state.mpm)
            except SimulationError:
                if not state.can_go_back:
                    raise
                continue
            self._decide("mpm", reason, value, noticed)
            if self._is_redone(noticed):
                return
            reason, value = "unsound", None

    def _is_redone(self, until: int) -> bool:
        """Let MPM redo frames; False where it fails and there is an earlier state to go back to."""
        try:
            while self._network.frame < until:
                self.state.mpm.advance(1)
                self._after_mpm(is_forced=False)
                if self.state.upsampler is not None:
                    self.state.upsampler.update()
        except SimulationError:
            if not self.state.can_go_back:
                raise
            self.state.backoff.restart(is_fault=True)
            return False
        return True

    def _warm_up(self, mpm: MpmSolver) -> None:
        """Bring a solver in the present state into one whose stress fits the network's motion."""
        network, checkpoints = self._network, self.state.checkpoints
        if not network.steps:
            return
        steps = min(handoff.STEPS, network.steps)
        first = checkpoints[0] if checkpoints else None
        made_by_mpm = first is not None and first.network.steps == 0 and steps == network.steps
        start = first.mpm if first is not None and made_by_mpm else None
        handoff.warm(mpm, network.track.states, r_t=self._r_t, start=start, steps=steps)

    def _decide(self, mode: Mode, reason: str, value: float | None, noticed: int | None = None) -> None:
        network = self._network
        self.state.mode, network.steps, network.network_steps = mode, 0, 0
        noticed = network.frame if noticed is None else noticed
        decision = Decision(frame=network.frame, mode=mode, value=value, reason=reason, noticed=noticed)
        self.state.log.append(decision)

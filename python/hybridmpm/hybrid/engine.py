"""The frame loop of the hybrid simulator: who simulates next, and how one hands over to the other."""

import contextlib
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import GraphSizeError, NonFiniteError, SimulationError
from hybridmpm.hybrid import handoff
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.guards import Safeguard
from hybridmpm.hybrid.state import Backoff, Checkpoint, HybridState, Moment
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track

NOISE_FLOOR = 0.05 * 9.81
"""Root mean square acceleration [m/s^2] below which a particle is calm."""
MIN_ACTIVE_SHARE = 0.02
"""Share of particles that are not calm below which the whole scene is calm."""

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class EngineSettings:
    """Settings that stay the same over a run."""

    window: int
    """Steps of the network in each of the safeguard's two windows of time."""
    safeguard: Safeguard
    """Which mean of the cosines the safeguard's value is."""
    handoff: handoff.Handoff
    """What MPM takes over from the network besides positions and velocities."""


class Engine:
    """A hybrid simulation without checks of arguments: its state, and the frame loop over it.

    Parameters
    ----------
    mpm : MpmSolver
        Solver at frame 0; the engine's own from now on.
    stepper : Stepper
        The network.
    guards : tuple of Guard
        Guards that watch the network, in the order of their stages.
    settings : EngineSettings
    """

    def __init__(
        self, mpm: MpmSolver, stepper: Stepper, guards: tuple[Guard, ...], settings: EngineSettings
    ) -> None:
        self._stepper, self._fresh_guards, self._settings = stepper, guards, settings
        self._fresh = mpm.snapshot()
        self.state = self._first_state(mpm)
        self.script: list[Decision] | None = None
        """Decisions of a log that is replayed, to follow in place of the guards'."""

    def _first_state(self, mpm: MpmSolver) -> HybridState:
        track = Track(self._stepper, mpm.scene, mpm.materials)
        history = _native.AccelerationHistory(
            mpm.particle_count,
            mpm.dim,
            window=self._settings.window,
            dt=track.step_dt,
            calm_acceleration=NOISE_FLOOR,
            min_active_share=MIN_ACTIVE_SHARE,
        )
        x = mpm.positions
        track.observe(x)
        history.push(x)
        moment = Moment(track, history, tuple(guard.copy() for guard in self._fresh_guards))
        return HybridState(mpm, moment, Backoff(self._settings.window))

    def reset(self) -> None:
        """Go back to frame 0."""
        self.state.mpm.restore(self._fresh)
        self.state = self._first_state(self.state.mpm)

    def copy(self) -> Self:
        """Return an independent engine in the same state, with the same network."""
        twin = copy.copy(self)
        twin.state = self.state.copy()
        return twin

    @property
    def is_between(self) -> bool:
        """Whether a step of the network is under way."""
        return self._now.track.is_under_way

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m], as shown."""
        track = self._now.track
        return track.positions if track.is_under_way else self.state.mpm.positions

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s], as shown."""
        track, ends = self._now.track, self._now.velocities
        if not track.is_under_way or ends is None:
            return self.state.mpm.velocities
        begin, end = ends
        return np.asarray(begin + np.float32(track.phase / track.r_t) * (end - begin))

    @property
    def _now(self) -> Moment:
        return self.state.moment

    @property
    def _guards(self) -> tuple[Guard, ...]:
        return self._now.guards

    @property
    def _r_t(self) -> int:
        return self._now.track.r_t

    def advance_frame(self, force: _Floats | None) -> None:
        """Advance by one frame, under a force (D,) or (N, D) [m/s^2] that is not zero everywhere, or None."""
        if force is not None and self.state.mode == "neural":
            with self._all_or_nothing():
                self._interrupt()
                self._advance_mpm(force)
            return
        if self.state.mode == "neural" and not self._now.track.is_under_way and not self._is_begun():
            return
        if self.state.mode == "mpm":
            self._advance_mpm(force)
            return
        if (self._now.frame + 1) % self._r_t == 0:
            self._end_step()
        else:
            self._now.frame += 1
            self._now.track.tick()

    # MPM simulates.

    def _advance_mpm(self, force: _Floats | None) -> None:
        try:
            self.state.mpm.advance(1, force)
        except SimulationError:
            # A state that MPM cannot go on from, shortly after it took over, is the network's doing.
            if not self.state.checkpoints or force is not None:
                raise
            with self._all_or_nothing():
                self.state.backoff.restart(is_fault=True)
                self._roll_back("unsound", None)
                self.state.mpm.advance(1)
        self._after_mpm(is_forced=force is not None)
        if self._may_enter(is_forced=force is not None):
            self._enter()

    def _after_mpm(self, *, is_forced: bool) -> None:
        """Take note of the frame that MPM has made."""
        state, now = self.state, self._now
        now.frame += 1
        if state.checkpoints and (
            is_forced or now.frame - state.log[-1].noticed > self._settings.window * self._r_t
        ):
            state.checkpoints.clear()
        if now.frame % self._r_t:
            return
        x = state.mpm.positions
        now.track.observe(x)
        signal = now.history.push(x)
        now.value = self._read(signal)
        view = View(x=x, mpm=state.mpm, r_t=self._r_t, steps=0, signal=signal)
        values = [(guard, guard.value(view)) for guard in self._guards if guard.stage is Stage.MOTION]
        calm = not is_forced and all(value is None or guard.is_quiet(value) for guard, value in values)
        state.backoff.count(is_calm=calm)

    def _read(self, signal: _native.AccelerationSignal) -> float | None:
        return signal.cosine if self._settings.safeguard == "ours" else signal.plain

    def _may_enter(self, *, is_forced: bool) -> bool:
        if self._now.frame % self._r_t or not self._now.track.ready:
            return False
        if self.script is not None:
            decision = self._scripted()
            return decision is not None and decision.mode == "neural"
        return self.state.backoff.is_over and not is_forced

    def _scripted(self) -> Decision | None:
        """Return the decision that holds at the present frame, by the log that is replayed."""
        held = [decision for decision in self.script or () if decision.frame <= self._now.frame]
        return held[-1] if held else None

    def left_by_script(self) -> bool:
        """Let MPM take over from the network here if the log that is replayed says so."""
        if self.state.mode == "mpm" or self._now.track.is_under_way:
            return False
        decision = self._scripted()
        if decision is None or decision.mode == "neural":
            return False
        with self._all_or_nothing():
            self.state.backoff.restart()
            self._leave(decision.reason, decision.value, noticed=decision.noticed)
        return True

    def _enter(self) -> None:
        state, now = self.state, self._now
        self._decide("neural", "calm" if state.log else "warm-up", now.value)
        state.checkpoints.clear()
        state.keep()
        if self.script is None and any(guard.stage is Stage.STATE for guard in self._guards):
            report = state.mpm.copy().prescribe(state.mpm.positions, state.mpm.velocities, now.frame)
            for guard in self._guards:
                guard.begin(report)

    # The network simulates.

    def _is_begun(self) -> bool:
        """Ask the network for a step; False where MPM has taken over and made the frame instead."""
        if self.left_by_script():
            self._advance_mpm(None)
            return False
        now = self._now
        try:
            x = now.track.answer()
        except GraphSizeError:
            if not self._guards:
                raise
            with self._all_or_nothing():
                self.state.backoff.restart(is_fault=True)
                self._roll_back("unsound", None)
                self._advance_mpm(None)
            return False
        alarm = self._alarm(Stage.RAW, x)
        if alarm is not None:
            with self._all_or_nothing():
                self._take_over(*alarm)
                self._advance_mpm(None)
            return False
        if not np.isfinite(x).all():
            worst = int(np.argmin(np.isfinite(x).all(axis=1)))
            raise NonFiniteError(
                f"the network's answer for particle {worst} is not finite in frame {now.frame}: "
                "let the guard 'non-finite' watch it"
            )
        x = np.clip(x, *now.track.walls)
        signal = now.history.push(x)
        try:
            alarm = self._alarm(Stage.MOTION, x, signal=signal)
        except BaseException:
            now.history.undo()
            raise
        if alarm is not None:
            now.history.undo()
            with self._all_or_nothing():
                self._take_over(*alarm)
                self._advance_mpm(None)
            return False
        now.value = self._read(signal)
        latest = now.track.states
        end = handoff.velocity([latest[-2], latest[-1], x], -1, now.track.step_dt)
        now.velocities = (self.state.mpm.velocities, end)
        now.track.begin(x)
        return True

    def _end_step(self) -> None:
        """Arrive where the network's step leads, and look whether that state is sound."""
        now, mpm = self._now, self.state.mpm
        assert now.velocities is not None  # noqa: S101 - a step ends where one began
        before = Checkpoint(now.copy(), mpm.snapshot())
        now.frame += 1
        try:
            report = mpm.prescribe(
                now.track.end, now.velocities[1], now.frame, deform=self._settings.handoff == "shadow"
            )
        except SimulationError:
            if not self._guards:
                now.frame -= 1
                raise
            with self._all_or_nothing(before):
                self.state.backoff.restart(is_fault=True)
                self._roll_back("unsound", None)
            return
        x = mpm.positions
        now.track.observe(x)
        now.steps += 1
        alarm = self._alarm(Stage.STATE, x, report=report)
        if alarm is not None:
            with self._all_or_nothing(before):
                self._take_over(*alarm)
            return
        if now.steps % self._settings.window == 0:
            self.state.keep()

    def _alarm(
        self,
        stage: Stage,
        x: _Floats,
        *,
        signal: _native.AccelerationSignal | None = None,
        report: _native.MotionReport | None = None,
    ) -> tuple[Guard, float] | None:
        """Ask the guards of a stage; return the first that alarms, with its value."""
        if self.script is not None:
            return None
        now = self._now
        steps = now.steps + (stage is not Stage.STATE)
        view = View(x=x, mpm=self.state.mpm, r_t=self._r_t, steps=steps, signal=signal, report=report)
        for guard in self._guards:
            value = guard.value(view) if guard.stage is stage else None
            if value is not None and guard.alarms(value):
                return guard, value
        return None

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

    def _take_over(self, guard: Guard, value: float) -> None:
        """Let MPM take over because of an alarm."""
        self.state.backoff.restart(steps=self._now.steps, is_fault=guard.is_fault)
        if guard.late:
            self._roll_back(guard.name, value)
        else:
            self._leave(guard.name, value)

    def _leave(self, reason: str, value: float | None, *, noticed: int | None = None) -> bool:
        """Let MPM go on from the present state; False where it had to go on from an earlier one."""
        try:
            self._hand_over()
        except SimulationError:
            if not self.state.checkpoints:
                raise
            self._roll_back(reason, value)
            return False
        self._decide("mpm", reason, value, noticed)
        return True

    def _roll_back(self, reason: str, value: float | None) -> None:
        """Go back to a state before the failure, and let MPM redo the frames since.

        Where MPM cannot go on from there, an earlier state is tried, as long as one is kept.
        """
        state, noticed = self.state, self._now.frame
        while True:
            while (
                len(state.checkpoints) > 1
                and self._now.steps - state.checkpoints[-1].moment.steps < self._settings.window // 2
            ):
                state.checkpoints.pop()
            state.take_back(state.checkpoints.pop())
            try:
                self._hand_over()
            except SimulationError:
                if not state.checkpoints:
                    raise
                continue
            self._decide("mpm", reason, value, noticed)
            if self._is_redone(noticed):
                return
            reason, value = "unsound", None

    def _is_redone(self, until: int) -> bool:
        """Let MPM redo frames; False where it fails and there is an earlier state to go back to."""
        try:
            while self._now.frame < until:
                self.state.mpm.advance(1)
                self._after_mpm(is_forced=False)
        except SimulationError:
            if not self.state.checkpoints:
                raise
            self.state.backoff.restart(is_fault=True)
            return False
        return True

    def _hand_over(self) -> None:
        """Bring MPM into a state that fits the network's motion."""
        now, mpm, checkpoints = self._now, self.state.mpm, self.state.checkpoints
        if not now.steps or self._settings.handoff == "shadow":
            return
        if self._settings.handoff == "cold":
            handoff.cold(mpm, self._fresh)
            return
        steps = min(handoff.STEPS, now.steps)
        first = checkpoints[0] if checkpoints else None
        made_by_mpm = first is not None and first.moment.steps == 0 and steps == now.steps
        start = first.mpm if first is not None and made_by_mpm else None
        handoff.warm(mpm, now.track.states, r_t=self._r_t, start=start, steps=steps)

    def _interrupt(self) -> None:
        """Let MPM go on from the present state because a force acts, be it amid a step of the network."""
        now, x, v = self._now, self.positions, self.velocities
        amid, phase = now.track.is_under_way, now.track.phase
        self.state.backoff.restart()
        if amid:
            now.track.drop()
            now.history.undo()
        if self._leave("force", now.value) and amid:
            self.state.mpm.advance(phase)
            self.state.mpm.prescribe(x, v, now.frame)

    def _decide(self, mode: Mode, reason: str, value: float | None, noticed: int | None = None) -> None:
        now = self._now
        self.state.mode, now.steps = mode, 0
        noticed = now.frame if noticed is None else noticed
        decision = Decision(frame=now.frame, mode=mode, value=value, reason=reason, noticed=noticed)
        self.state.log.append(decision)

"""The frame loop of the hybrid simulator: who simulates next."""

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.decisions import Decision
from hybridmpm.errors import GraphSizeError, NonFiniteError, SimulationError
from hybridmpm.hybrid import handoff
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.switch import Switch, SwitchSettings
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.stepper import Stepper

_Floats = npt.NDArray[np.float32]


class Engine(Switch):
    """A hybrid simulation without checks of arguments: the frame loop."""

    def __init__(
        self,
        mpm: MpmSolver,
        stepper: Stepper,
        guards: tuple[Guard, ...],
        settings: SwitchSettings,
        *,
        carry: bool,
    ) -> None:
        super().__init__(mpm, stepper, guards, settings, carry=carry)
        self.script: list[Decision] | None = None
        """Decisions of a log that is replayed, to follow in place of the guards'."""

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
        before = self.state.checkpoint()
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

    def _take_over(self, guard: Guard, value: float) -> None:
        """Let MPM take over because of an alarm."""
        self.state.backoff.restart(steps=self._now.steps, is_fault=guard.is_fault)
        if guard.late:
            self._roll_back(guard.name, value)
        else:
            self._leave(guard.name, value)

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

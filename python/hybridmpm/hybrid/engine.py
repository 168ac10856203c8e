"""The frame loop of the hybrid simulator: who simulates next."""

import functools

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.decisions import Answerer, Decision
from hybridmpm.errors import NonFiniteError, SimulationError
from hybridmpm.hybrid import handoff
from hybridmpm.hybrid.asking import is_of_caller
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.switch import Switch, SwitchSettings
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.stepper import Stepper

_UNDONE_WITH_FAILURE = 2
"""Steps that are undone with one in which the network failed: particles clump before it does."""

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
        show_all: bool,
    ) -> None:
        super().__init__(mpm, stepper, guards, settings, show_all=show_all)
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
            self._now.tick()
            self._now.track.tick()

    # MPM simulates.

    def _advance_mpm(self, force: _Floats | None) -> None:
        try:
            self.state.mpm.advance(1, force)
        except SimulationError:
            # A state that MPM cannot go on from, shortly after it took over, is the network's doing.
            if not self.state.can_go_back or force is not None:
                raise
            with self._all_or_nothing():
                self._advance_from_earlier()
        self._after_mpm(is_forced=force is not None)
        reason = self._entry(is_forced=force is not None)
        if reason is not None:
            self._decide("neural", reason, self._now.value)
            # A state that a network left behind may fail some frames later only.
            self.state.begin_with_present(self._now.frame - 4 * self._settings.window * self._r_t)

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

    def _entry(self, *, is_forced: bool) -> str | None:
        """Return for what reason the network takes over here, None where it does not."""
        if self._now.frame % self._r_t or not self._now.track.ready:
            return None
        if self.script is not None:
            decision = self._scripted()
            return decision.reason if decision is not None and decision.mode == "neural" else None
        if is_forced:
            return None
        if self.state.backoff.is_over:
            return "calm" if self.state.log else "warm-up"
        quick = self._quick()
        return None if quick is None else quick[1]

    def _quick(self) -> tuple[_Floats, Answerer] | None:
        """Return what free fall or rest say about the next step, and which of them."""
        return None if self._shortcuts is None else self._shortcuts.answer(self._now.track)

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

    # The network simulates.

    def _is_begun(self) -> bool:
        """Ask the network for a step; False where MPM has taken over and made the frame instead."""
        if self.left_by_script():
            self._advance_mpm(None)
            return False
        quick = self._quick()
        if quick is not None:
            self._begin(*quick, self._now.history.push(quick[0]))
            return True
        x = self._answer()
        return x is not None and self._is_accepted(x)

    def _answer(self) -> _Floats | None:
        """Ask the network where its step leads (N, D) [m]; None where MPM has made the frame instead."""
        track = self._now.track
        try:
            x = self._asker.ask(track.answer)
        except Exception as error:
            if not self._guards or is_of_caller(error):
                raise
            with self._all_or_nothing():
                now = self._now
                self.state.backoff.restart(steps=now.asked, is_fault=True)
                self._roll_back("unsound", None, steps=now.steps - min(_UNDONE_WITH_FAILURE, now.asked))
                self._advance_mpm(None)
            return None
        alarm = self._alarm(Stage.RAW, x)
        if alarm is not None:
            self._refuse(*alarm)
            return None
        if not np.isfinite(x).all():
            worst = int(np.argmin(np.isfinite(x).all(axis=1)))
            raise NonFiniteError(
                f"the network's answer for particle {worst} is not finite in frame {self._now.frame}: "
                "let the guard 'non-finite' watch it"
            )
        x = np.clip(x, *track.walls)
        if self._shortcuts is not None:
            resting = self._shortcuts.resting(track)
            x[resting] = track.states[-1][resting]
        return x

    def _is_accepted(self, x: _Floats) -> bool:
        """Begin the step that leads to x; False where guards refuse it and MPM has made the frame instead."""
        now = self._now
        if now.asked == 0 and self.script is None:
            self._begin_guards()
        signal = now.history.push(x)
        try:
            alarm = self._alarm(Stage.MOTION, x, signal=signal)
        except BaseException:
            now.history.undo()
            raise
        if alarm is not None:
            now.history.undo()
            self._refuse(*alarm)
            return False
        self._begin(x, "network", signal)
        return True

    def _begin_guards(self) -> None:
        """Let the guards take note of the state in which the network is asked first."""
        mpm = self.state.mpm
        report = mpm.copy().prescribe(mpm.positions, mpm.velocities, self._now.frame)
        for guard in self._guards:
            guard.begin(report)

    def _begin(self, x: _Floats, by: Answerer, signal: _core.AccelerationSignal) -> None:
        """Begin a step that leads to x (N, D) [m]."""
        now = self._now
        now.answered_by = by
        now.value = self._read(signal)
        latest = now.track.states
        end = handoff.velocity([latest[-2], latest[-1], x], -1, now.track.step_dt)
        if by == "rest":
            end = np.zeros_like(end)
        now.velocities = (self.state.mpm.velocities, end)
        now.track.begin(x)

    def _end_step(self) -> None:
        """Arrive where the network's step leads, and look whether that state is sound."""
        now, mpm = self._now, self.state.mpm
        assert now.velocities is not None  # noqa: S101 - a step ends where one began
        before = self.state.checkpoint()
        now.tick()
        try:
            report = mpm.prescribe(
                now.track.end, now.velocities[1], now.frame, deform=self._settings.handoff == "shadow"
            )
        except SimulationError:
            if not self._guards:
                now.frame, now.answered = before.moment.frame, before.moment.answered
                raise
            with self._all_or_nothing(before):
                self.state.backoff.restart(steps=now.asked, is_fault=True)
                self._roll_back("unsound", None)
            return
        x = mpm.positions
        now.track.observe(x)
        now.steps += 1
        now.asked = now.asked + 1 if now.answered_by == "network" else 0
        alarm = self._alarm(Stage.STATE, x, report=report) if now.asked else None
        if alarm is not None:
            guard, value = alarm
            with self._all_or_nothing(before):
                self.state.backoff.restart(steps=now.asked, is_fault=guard.is_fault)
                self._roll_back(guard.name, value, steps=now.steps - 1 - min(guard.undo, now.asked - 1))
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
        """Ask the guards of a stage; return the first that alarms, with its value."""
        if self.script is not None:
            return None
        now, own = self._now, functools.cache(self._own_step)
        steps = now.asked + (stage is not Stage.STATE)
        view = View(
            x=x, mpm=self.state.mpm, r_t=self._r_t, steps=steps, signal=signal, report=report, own=own
        )
        for guard in self._guards:
            value = guard.value(view) if guard.stage is stage else None
            if value is not None and guard.alarms(value):
                return guard, value
        return None

    # From one to the other.

    def _refuse(self, guard: Guard, value: float) -> None:
        """Let MPM take over because of an alarm about a step that has not begun, and make the frame."""
        now = self._now
        with self._all_or_nothing():
            self.state.backoff.restart(steps=now.asked, is_fault=guard.is_fault)
            undone = min(guard.undo, now.asked)
            if undone:
                self._roll_back(guard.name, value, steps=now.steps - undone)
            else:
                self._leave(guard.name, value)
            self._advance_mpm(None)

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

"""The frame loop of the hybrid simulator: who simulates next, and how one hands over to the other."""

import copy
from collections import deque
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm.errors import GraphSizeError, NonFiniteError, SimulationError
from hybridmpm.hybrid import handoff as handoffs
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.guards import Safeguard
from hybridmpm.hybrid.log import Decision, Mode
from hybridmpm.hybrid.network import Network
from hybridmpm.hybrid.state import Checkpoint, Patience, Step
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.spec import HISTORY

NOISE_FLOOR = 0.05 * 9.81
"""A particle is calm whose root mean square acceleration is below this [m/s^2]."""
QUORUM = 0.02
"""With a smaller share of particles that are not calm the scene is calm."""

_CHECKPOINTS = 4

_Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What stays the same over a run."""

    window: int
    safeguard: Safeguard
    handoff: handoffs.Handoff


class Engine:
    """State of a hybrid simulation, and the frame loop over it.

    Parameters
    ----------
    mpm : MpmSolver
        At frame 0; the engine's own from now on.
    network : Network
    guards : tuple of Guard
    settings : Settings
    """

    def __init__(
        self, mpm: MpmSolver, network: Network, guards: tuple[Guard, ...], settings: Settings
    ) -> None:
        self.mpm = mpm
        """At the state shown, or during a step of the network at its beginning."""
        self._network, self._settings = network, settings
        self._fresh = mpm.snapshot()
        self.frame = 0
        self.mode: Mode = "mpm"
        self.value: float | None = None
        """Of the safeguard."""
        self.log: list[Decision] = []
        self.script: list[Decision] | None = None
        """Decisions to follow in place of the guards'."""
        self._guards = tuple(guard.copy() for guard in guards)
        self._step: Step | None = None
        self._steps = 0
        self._path: deque[_Floats] = deque([mpm.positions], maxlen=HISTORY)
        self._history = _native.AccelerationHistory(
            mpm.particle_count,
            mpm.dim,
            window=settings.window,
            dt=network.dt,
            floor=NOISE_FLOOR,
            quorum=QUORUM,
        )
        self._history.push(self._path[0])
        self._checkpoints: deque[Checkpoint] = deque(maxlen=_CHECKPOINTS)
        self._patience = Patience(settings.window)
        self._is_redoing = False

    def copy(self) -> Self:
        """Return an independent engine in the same state, with the same network."""
        twin = copy.copy(self)
        twin.mpm = self.mpm.copy()
        twin._history = self._history.copy()  # noqa: SLF001 - of this very class
        twin._guards = tuple(guard.copy() for guard in self._guards)  # noqa: SLF001
        twin.log = list(self.log)
        twin._path = self._path.copy()  # noqa: SLF001
        twin._checkpoints = self._checkpoints.copy()  # noqa: SLF001
        twin._patience = copy.copy(self._patience)  # noqa: SLF001
        return twin

    @property
    def is_between(self) -> bool:
        """Whether a step of the network is under way."""
        return self._step is not None

    @property
    def positions(self) -> _Floats:
        """(N, D) [m], as shown."""
        return self.mpm.positions if self._step is None else self._step.x.at(self._moment)

    @property
    def velocities(self) -> _Floats:
        """(N, D) [m/s], as shown."""
        if self._step is None:
            return self.mpm.velocities
        begin, end = self._step.v
        return np.asarray(begin + np.float32(self._moment) * (end - begin))

    @property
    def _moment(self) -> float:
        """Part of the step under way that is over."""
        return (self.frame % self._network.r_t) / self._network.r_t

    def advance_frame(self, force: _Floats | None) -> None:
        """Go on by one frame, under a force (N, D) [m/s^2] that is not zero everywhere, or None."""
        if force is not None and self.mode == "neural":
            self._interrupt()
        if self.mode == "neural" and self._step is None:
            self._begin_step()
        if self.mode == "mpm":
            self._advance_mpm(force)
            return
        self.frame += 1
        if self.frame % self._network.r_t == 0:
            self._end_step()

    # MPM simulates.

    def _advance_mpm(self, force: _Floats | None = None) -> None:
        try:
            self.mpm.advance(1, force)
        except SimulationError:
            # What MPM cannot go on from, shortly after it took over, is the network's doing.
            if not self._checkpoints or force is not None:
                raise
            self._patience.renew(is_fault=True)
            self._roll_back("unsound", None)
            self.mpm.advance(1)
        self.frame += 1
        if self._checkpoints and (
            force is not None or self.frame - self.log[-1].noticed > self._settings.window * self._network.r_t
        ):
            self._checkpoints.clear()
        if self.frame % self._network.r_t:
            return
        x = self.mpm.positions
        self._path.append(x)
        signal = self._history.push(x)
        self.value = self._read(signal)
        view = View(x=x, mpm=self.mpm, r_t=self._network.r_t, steps=0, signal=signal)
        values = [(guard, guard.value(view)) for guard in self._guards if guard.stage is Stage.MOTION]
        calm = force is None and all(value is None or guard.is_quiet(value) for guard, value in values)
        self._patience.see(is_calm=calm)
        if self._may_enter(is_forced=force is not None):
            self._enter()

    def _read(self, signal: _native.AccelerationSignal) -> float | None:
        return signal.cosine if self._settings.safeguard == "ours" else signal.plain

    def _may_enter(self, *, is_forced: bool) -> bool:
        if len(self._path) < HISTORY or self._is_redoing:
            return False
        if self.script is not None:
            decision = self._scripted()
            return decision is not None and decision.mode == "neural"
        return self._patience.is_over and not is_forced

    def _scripted(self) -> Decision | None:
        """Return the decision that holds at the present frame, by the log that is replayed."""
        held = [decision for decision in self.script or () if decision.frame <= self.frame]
        return held[-1] if held else None

    def left_by_script(self) -> bool:
        """Let MPM take over from the network here if the log that is replayed says so."""
        decision = self._scripted()
        if self.mode == "mpm" or self._step is not None or decision is None or decision.mode == "neural":
            return False
        self._patience.renew()
        self._leave(decision.reason, decision.value, noticed=decision.noticed)
        return True

    def _enter(self) -> None:
        self._decide("neural", "calm" if self.log else "warm-up", self.value)
        self._steps = 0
        self._checkpoints.clear()
        self._keep()
        if self.script is None and any(guard.stage is Stage.STATE for guard in self._guards):
            report = self.mpm.copy().prescribe(self.mpm.positions, self.mpm.velocities, self.frame)
            for guard in self._guards:
                guard.begin(report)

    # The network simulates.

    def _begin_step(self) -> None:
        """Ask the network for a step, or leave it to MPM."""
        if self.left_by_script():
            return
        try:
            x = self._network.step(self._path)
        except GraphSizeError:
            if not self._guards:
                raise
            self._patience.renew(is_fault=True)
            self._roll_back("unsound", None)
            return
        if self._is_alarmed(Stage.RAW, x):
            return
        if not np.isfinite(x).all():
            worst = int(np.argmin(np.isfinite(x).all(axis=1)))
            raise NonFiniteError(
                f"the network's answer for particle {worst} is not finite in frame {self.frame}: "
                "let the guard 'non-finite' watch it"
            )
        x = np.clip(x, self._network.walls[0], self._network.walls[1])
        signal = self._history.push(x)
        if self._is_alarmed(Stage.MOTION, x, signal=signal):
            return
        self.value = self._read(signal)
        latest = self._path[-1]
        v = handoffs.velocity([self._path[-2], latest, x], -1, self._network.dt)
        between = self._network.between(self._path[-2], latest, x)
        self._step = Step(x=between, v=(self.mpm.velocities, v))

    def _end_step(self) -> None:
        """Arrive where the network's step leads, and look whether that state is sound."""
        step, self._step = self._step, None
        assert step is not None  # noqa: S101 - a step ends where one began
        try:
            report = self.mpm.prescribe(
                step.x.end, step.v[1], self.frame, deform=self._settings.handoff == "shadow"
            )
        except SimulationError:
            if not self._guards:
                self.frame, self._step = self.frame - 1, step
                raise
            self._patience.renew(is_fault=True)
            self._roll_back("unsound", None)
            return
        x = self.mpm.positions
        self._path.append(x)
        self._steps += 1
        if self._is_alarmed(Stage.STATE, x, report=report):
            return
        if self._steps % self._settings.window == 0:
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
        if self.script is not None:
            return False
        steps = self._steps + (stage is not Stage.STATE)
        view = View(x=x, mpm=self.mpm, r_t=self._network.r_t, steps=steps, signal=signal, report=report)
        for guard in self._guards:
            if guard.stage is not stage:
                continue
            value = guard.value(view)
            if value is None or not guard.alarms(value):
                continue
            if stage is Stage.MOTION:
                self._history.undo()
            self._patience.renew(steps=self._steps, is_fault=guard.is_fault)
            if guard.late:
                self._roll_back(guard.name, value)
            else:
                self._leave(guard.name, value)
            return True
        return False

    # From one to the other.

    def _keep(self) -> None:
        self._checkpoints.append(
            Checkpoint(
                frame=self.frame,
                steps=self._steps,
                mpm=self.mpm.snapshot(),
                path=tuple(self._path),
                history=self._history.copy(),
                guards=tuple(guard.copy() for guard in self._guards),
                value=self.value,
            )
        )

    def _roll_back(self, reason: str, value: float | None) -> None:
        """Go back to a state before the failure, and let MPM redo the frames since."""
        noticed = self.frame
        while (
            len(self._checkpoints) > 1
            and self._steps - self._checkpoints[-1].steps < self._settings.window // 2
        ):
            self._checkpoints.pop()
        back = self._checkpoints.pop()
        self.mpm.restore(back.mpm)
        self.frame, self._steps, self.value, self._step = back.frame, back.steps, back.value, None
        self._path.clear()
        self._path.extend(back.path)
        self._history = back.history.copy()
        self._guards = tuple(guard.copy() for guard in back.guards)
        self._leave(reason, value, noticed=noticed)
        self._is_redoing = True
        try:
            while self.frame < noticed:
                self._advance_mpm()
        finally:
            self._is_redoing = False

    def _leave(self, reason: str, value: float | None, *, noticed: int | None = None) -> bool:
        """Let MPM go on from the present state; false where it had to go on from an earlier one."""
        if self._steps and not self._is_handed_over(reason, value):
            return False
        self._decide("mpm", reason, value, noticed)
        self._steps = 0
        return True

    def _is_handed_over(self, reason: str, value: float | None) -> bool:
        """Bring MPM into a state that fits the network's; where it cannot follow, go back further."""
        if self._settings.handoff == "shadow":
            return True
        if self._settings.handoff == "cold":
            handoffs.cold(self.mpm, self._fresh)
            return True
        steps = min(handoffs.STEPS, self._steps)
        first = self._checkpoints[0] if self._checkpoints else None
        start = first.mpm if first is not None and first.steps == 0 and steps == self._steps else None
        try:
            handoffs.warm(self.mpm, self._path, r_t=self._network.r_t, start=start, steps=steps)
        except SimulationError:
            if not self._checkpoints:
                raise
            self._roll_back(reason, value)
            return False
        return True

    def _interrupt(self) -> None:
        """Let MPM go on from the present state because a force acts, be it amid a step of the network."""
        step, x, v = self._step, self.positions, self.velocities
        self._patience.renew()
        if step is not None:
            self._step = None
            self._history.undo()
        if self._leave("force", self.value) and step is not None:
            self.mpm.advance(self.frame % self._network.r_t)
            self.mpm.prescribe(x, v, self.frame)

    def _decide(self, mode: Mode, reason: str, value: float | None, noticed: int | None = None) -> None:
        self.mode = mode
        self.log.append(
            Decision(
                frame=self.frame,
                mode=mode,
                value=value,
                reason=reason,
                noticed=self.frame if noticed is None else noticed,
            )
        )

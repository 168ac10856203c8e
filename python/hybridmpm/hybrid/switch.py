"""From one simulator to the other: the state of a hybrid simulation, and how MPM takes over."""

import contextlib
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.coarse.merging import spacing_at
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid import handoff
from hybridmpm.hybrid.asking import Asker
from hybridmpm.hybrid.guard import Guard, Stage, View
from hybridmpm.hybrid.guards import Safeguard
from hybridmpm.hybrid.shortcuts import Shortcuts
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
class SwitchSettings:
    """Settings that stay the same over a run."""

    window: int
    """Steps of the network in each of the safeguard's two windows of time."""
    wait: int
    """Steps of MPM before the network's next chance, where it has not failed repeatedly."""
    patience: float
    """Time after which a network that does not answer counts as one that failed [s]."""
    shortcuts: bool
    """Answer free fall and rest without the network."""
    safeguard: Safeguard
    """Which mean of the cosines the safeguard's value is."""
    handoff: handoff.Handoff
    """What MPM takes over from the network besides positions and velocities."""


class Switch:
    """State of a hybrid simulation, and the ways from the network to MPM.

    Parameters
    ----------
    mpm : MpmSolver
        Solver at frame 0; the switch's own from now on.
    stepper : Stepper
        The network.
    guards : tuple of Guard
        Guards that watch the network, in the order of their stages.
    settings : SwitchSettings
    show_all : bool
        Carry all particles of the scene along.
    """

    def __init__(
        self,
        mpm: MpmSolver,
        stepper: Stepper,
        guards: tuple[Guard, ...],
        settings: SwitchSettings,
        *,
        show_all: bool,
    ) -> None:
        self._stepper, self._fresh_guards, self._settings = stepper, guards, settings
        self._show_all = show_all
        self._asker = Asker(settings.patience)
        self._shortcuts = Shortcuts(spacing_at(mpm.scene, mpm.r_p)) if settings.shortcuts else None
        self._fresh = mpm.snapshot()
        self.state = self._first_state(mpm)

    def _first_state(self, mpm: MpmSolver) -> HybridState:
        track = Track(self._stepper, mpm.scene, mpm.materials)
        history = _core.AccelerationHistory(
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
        upsampler = mpm.upsampler_for(self) if self._show_all else None
        return HybridState(mpm, moment, Backoff(self._settings.wait), upsampler)

    def reset(self) -> None:
        """Go back to frame 0."""
        self.state.mpm.restore(self._fresh)
        self.state = self._first_state(self.state.mpm)

    def copy(self) -> Self:
        """Return an independent engine in the same state, with the same network."""
        twin = copy.copy(self)
        twin.state = self.state.copy(twin)
        return twin

    @property
    def is_between(self) -> bool:
        """Whether a step of the network is under way."""
        return self._now.track.is_under_way

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._now.frame

    @property
    def particle_count(self) -> int:
        """Number N of particles."""
        return self.state.mpm.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) of the particles: 0, 1, ..."""
        return self.state.mpm.ids

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (N,) into the scene's materials."""
        return self.state.mpm.material

    @property
    def mass(self) -> _Floats:
        """Masses (N,) [kg]."""
        return self.state.mpm.mass

    @property
    def affine(self) -> _Floats:
        """Velocity gradients (N, D, D) [1/s]; within a step of the network those at its beginning."""
        return self.state.mpm.affine

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m]; a copy."""
        track = self._now.track
        return track.positions.copy() if track.is_under_way else self.state.mpm.positions

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s]; a copy."""
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

    def _leave(self, reason: str, value: float | None, *, noticed: int | None = None) -> bool:
        """Let MPM go on from the present state; False where it had to go on from an earlier one."""
        try:
            self._hand_over()
        except SimulationError:
            if not self.state.can_go_back:
                raise
            self._roll_back(reason, value)
            return False
        self._decide("mpm", reason, value, noticed)
        return True

    def _roll_back(self, reason: str, value: float | None, *, steps: int | None = None) -> None:
        """Go back to a state before the failure, and let MPM redo the frames since.

        The state is where the network had made so many steps, or fewer where no such state is kept; the
        latest where `steps` is None. Where MPM cannot go on from there, an earlier one is tried, as long as
        one is kept.
        """
        state, noticed = self.state, self._now.frame
        while True:
            while (
                len(state.checkpoints) > 1
                and steps is not None
                and state.checkpoints[-1].moment.steps > steps
            ):
                state.checkpoints.pop()
            state.go_back()
            if state.upsampler is not None:
                # Checkpoints are taken before the upsampler has followed to their frame.
                state.upsampler.follow()
            try:
                self._hand_over()
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
            while self._now.frame < until:
                self.state.mpm.advance(1)
                self._after_mpm(is_forced=False)
                if self.state.upsampler is not None:
                    self.state.upsampler.follow()
        except SimulationError:
            if not self.state.can_go_back:
                raise
            self.state.backoff.restart(is_fault=True)
            return False
        return True

    def _hand_over(self) -> None:
        """Bring MPM into a state that fits the network's motion."""
        self._adapt(self.state.mpm)

    def _adapt(self, mpm: MpmSolver) -> None:
        """Bring a solver in the present state into one that fits the network's motion."""
        now, checkpoints = self._now, self.state.checkpoints
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

    def _own_step(self) -> _Floats | None:
        """Return where MPM would lead in a step from the present state, (N, D) [m]; None where it fails."""
        twin = self.state.mpm.copy()
        try:
            self._adapt(twin)
            twin.advance(self._r_t)
        except SimulationError:
            return None
        return twin.positions

    def _decide(self, mode: Mode, reason: str, value: float | None, noticed: int | None = None) -> None:
        now = self._now
        self.state.mode, now.steps, now.asked = mode, 0, 0
        noticed = now.frame if noticed is None else noticed
        decision = Decision(frame=now.frame, mode=mode, value=value, reason=reason, noticed=noticed)
        self.state.log.append(decision)

    def _after_mpm(self, *, is_forced: bool) -> None:
        """Take note of the frame that MPM has made."""
        state, now = self.state, self._now
        now.frame += 1
        if state.can_go_back and (
            is_forced or now.frame - state.log[-1].noticed > self._settings.window * self._r_t
        ):
            state.forget()
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

    def _read(self, signal: _core.AccelerationSignal) -> float | None:
        return signal.cosine if self._settings.safeguard == "ours" else signal.plain

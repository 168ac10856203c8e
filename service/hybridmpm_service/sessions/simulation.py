"""One running simulation: a simulator, its sketch and hand, and the times of its frames.

It is used by one thread at a time. Threads, asyncio and HTTP are absent; `Session` adds the first two.
"""

import statistics
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm import FrameCancelledError, MpmSolver, Scene, SimulationError
from hybridmpm.control import Led, Pull, Push, restored
from hybridmpm.errors import ConfigError
from hybridmpm.force import total_force
from hybridmpm.playing import ways_file
from hybridmpm.recording import Recording, record
from hybridmpm.simulator import Simulator
from hybridmpm.stream_frames import Frame, FrameMessage
from hybridmpm_service.errors import LeadRefusedError, PressureUnknownError
from hybridmpm_service.sessions.inputs import (
    Grip,
    Hand,
    HandInput,
    Input,
    PullInput,
    PushInput,
    ReleaseInput,
    SketchInput,
    hand_input,
    hand_record,
)
from hybridmpm_service.sessions.journal import Journal
from hybridmpm_service.sessions.player import Clock
from hybridmpm_service.sessions.session_file import Checkpoint
from hybridmpm_service.sessions.solvers import ChosenSolver
from hybridmpm_service.sessions.steering import Steered, Steering
from hybridmpm_service.sessions.view import (
    CellMeans,
    Control,
    Forces,
    LastFrame,
    Particles,
    SafeguardRecorder,
    Timing,
    View,
    frame_of,
)

_TIMES_KEPT = 400
"""Number of latest frames whose solver times are kept."""
_FORCES_KEPT = 40
"""Number of the latest frames over which forces are averaged."""
_PACE_WINDOW_SECONDS = 1.0
"""Length of the time over which the pace of the frames is measured."""


class Simulation:
    """A simulator that a sketch and a hand can steer.

    Parameters
    ----------
    chosen : ChosenSolver
        Simulator at frame 0; it may not be used elsewhere from now on.
    clock : Clock
    journal : Journal, optional
        A new one if absent.

    Attributes
    ----------
    journal : Journal
    computed_seconds : float
        Time of all frames that this object has computed [s].
    """

    def __init__(self, chosen: ChosenSolver, *, clock: Clock, journal: Journal | None = None) -> None:
        self.journal = journal or Journal()
        self.computed_seconds = 0.0
        self._solver = chosen.simulator
        if self._solver.kind == "mpm":
            self._solver.keep_forces()
        is_hybrid = chosen.simulator.kind == "hybrid"
        self._recorder = SafeguardRecorder(chosen.simulator, chosen.r_c) if is_hybrid else None
        self._clock = clock
        self._steering: Steering | None = None
        self._control: Control | None = None
        self._steered = False
        self.hand: Push | Pull | None = None
        """Force of a hand in the next frame. May be set from any thread."""
        self._noted_hand: Push | Pull | None = None
        self._promised: deque[HandInput] = deque()
        self._promised_until = 0
        self._milliseconds: deque[float] = deque(maxlen=_TIMES_KEPT)
        self._finished: deque[float] = deque()
        self._forces: deque[npt.NDArray[np.float64]] = deque(maxlen=_FORCES_KEPT)
        self._frame_dt = self.scene.frame_dt
        self.solids = [one.solid() | {"mass": one.mass} for one in self.scene.rigid]
        """Shapes and masses of the rigid bodies, as `Rigid.solid` returns them."""

    @property
    def scene(self) -> Scene:
        """Scene that is simulated."""
        return self._solver.scene

    @property
    def kind(self) -> str:
        """Kind of the simulator: mpm, neural or hybrid."""
        return self._solver.kind

    @property
    def frame(self) -> int:
        """Number of frames since the start."""
        return self._solver.frame

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene."""
        return self._solver.r_p

    @property
    def spacing(self) -> float:
        """Distance of neighbouring particles at rest [m]."""
        return self._solver.particle_spacing

    @property
    def types(self) -> npt.NDArray[np.uint8] | None:
        """DeepMind's particle types (N,); None where particles come and go: each frame has its own then."""
        return None if self.scene.is_open else self._solver.materials

    def advance(self, frames: int, go_on: Callable[[], bool] = lambda: True) -> int:
        """Compute frames as long as `go_on()` is true before each; return their number.

        Raises
        ------
        SimulationError
            A frame failed; the state is the one before it.
        """
        for done in range(frames):
            if not go_on():
                return done
            self._one_frame()
            self.journal.settle(self.computed_seconds, self.checkpoint)
        return frames

    def promise(self, until: int, inputs: Sequence[HandInput]) -> None:
        """Note the inputs of a tab that has computed frames, for `catch_up`; none is lost from now on.

        Parameters
        ----------
        until : int
            Frame that the tab has computed.
        inputs : sequence of PushInput and PullInput
            Inputs of frames up to that one, in their order.
        """
        self.journal.promise(inputs, until)
        self._promised.extend(inputs)
        self._promised_until = until

    @property
    def behind(self) -> int:
        """Number of frames by which a tab is ahead of this simulation. Safe to read from any thread."""
        return max(0, self._promised_until - self._solver.frame)

    def catch_up(self) -> None:
        """Compute all frames that a tab has computed, with its inputs.

        Raises
        ------
        SimulationError
            A frame failed. The state is the one before it, and what the tab did later is forgotten.
        """
        try:
            self.advance(self.behind)
        finally:
            self._let_promised_act()

    def _let_promised_act(self) -> None:
        """Let those inputs of a tab act that are of the present frame."""
        while self._promised and self._promised[0].frame <= self.frame:
            self._noted_hand = self._promised.popleft().force()
            self.journal.acted()

    def _forget_promised(self) -> None:
        if self._promised or self.behind:
            self._promised.clear()
            self._promised_until = self.frame
            self.hand = self._noted_hand
            self.journal.take_back(self.checkpoint())

    def start_file(self) -> tuple[int, str, bytes]:
        """Return the present frame, the digest of its state, and what a tab needs to go on from it.

        Raises
        ------
        LeadRefusedError
            A network moves the particles, or may.
        """
        if not isinstance(self._solver, MpmSolver):
            raise LeadRefusedError("a tab computes frames of MPM alone: networks run on servers only")
        return self.frame, self._solver.digest(), self._solver.start_file()

    def ways(self) -> bytes:
        """Return what a tab follows from the present frame on: the law of the sketch, if one steers.

        Raises
        ------
        LeadRefusedError
            The law of the sketch is none of those that tabs have.
        """
        if self._steering is None:
            return ways_file([], 0, 0)
        try:
            return self._steering.ways()
        except ConfigError:
            method = self._steering.guidance.method
            raise LeadRefusedError(
                f"a sketch steers by the method {method}, whose forces only the server computes: try again "
                "when it has ended"
            ) from None

    @property
    def steered_until(self) -> int | None:
        """Frame after which the sketch that steers acts no longer; None without one."""
        return None if self._steering is None else self._steering.ends_at

    def note_hand(self) -> Push | Pull | None:
        """Let the hand act from the present frame on, and return its force."""
        hand = self.hand
        if hand is not self._noted_hand:
            self.journal.add(hand_input(self.frame, hand))
            self._noted_hand = hand
        return hand

    def copy(self) -> Simulator:
        """Return a copy of the simulator in its present state."""
        return self._solver.copy()

    def fork(self) -> "Simulation":
        """Return an independent simulation in the present state, under the same sketch.

        A hand stays with its viewer. Times are measured anew.
        """
        twin = Simulation(ChosenSolver(self._solver.copy()), clock=self._clock, journal=self.journal.fork())
        solver = twin._solver
        twin._recorder = None if self._recorder is None else self._recorder.on(solver)
        twin._steering = None if self._steering is None else self._steering.on(solver)
        twin._control, twin._steered = self._control, self._steered
        twin._noted_hand = self._noted_hand
        twin.let_go()
        return twin

    @property
    def steered(self) -> Steered | None:
        """The sketch that steers; None without one. Safe to read from any thread."""
        steering = self._steering
        if steering is None or steering.control.first_frame is None:
            return None
        return Steered(steering.control.number, steering.control.first_frame, steering.guidance)

    @property
    def shown_hand(self) -> Hand | Grip | None:
        """The hand that acts; None without one. Safe to read from any thread."""
        # While a tab is ahead, the hand is that of its frames.
        return hand_record(self._noted_hand if self.behind else self.hand)

    def steer(self, guidance: Led, number: int, settings: Mapping[str, Any]) -> Steered:
        """Let a guidance steer from the next frame on; it replaces the one before.

        Parameters
        ----------
        guidance : Guidance or Sequence
            Made for a copy of the simulator, perhaps some frames ago.
        number : int
            Number of the sketch in its session.
        settings : mapping
            Arguments of `hybridmpm.control.prepare` for the guidance.
        """
        made = SketchInput.of(guidance, settings, frame=self.frame, number=number)
        self.journal.add(made, guidance.snapshot)
        self.act(made, guidance)
        return Steered(number, self._solver.frame, guidance)

    def release(self) -> None:
        """End the sketch that steers."""
        if self._control is not None:
            made = ReleaseInput(frame=self.frame)
            self.journal.add(made)
            self.act(made)

    def let_go(self) -> None:
        """End the push of a hand, in the present frame."""
        if self._noted_hand is not None:
            made = PushInput(frame=self.frame, push=None)
            self.journal.add(made)
            self.act(made)
        self.hand = None

    def act(self, one: Input, guidance: Led | None = None) -> None:
        """Let an input act that the journal contains already; a sketch comes with its guidance."""
        if isinstance(one, PushInput | PullInput):
            self.hand = self._noted_hand = one.force()
        elif isinstance(one, SketchInput) and guidance is not None:
            self._steering = Steering(one.number, guidance, self._solver)
            self._control = self._steering.control
        else:
            self._steering = self._control = None

    def reset(self) -> None:
        """Return to frame 0, without sketch and hand."""
        self.journal.clear()
        self._solver.reset()
        self._forces.clear()
        self._steering = self._control = None
        self.hand = self._noted_hand = None
        self._promised.clear()
        self._promised_until = 0
        if self._recorder is not None:
            self._recorder.restore()
        self._steered = False

    def checkpoint(self) -> Checkpoint:
        """Return the state, for `recall` by a simulation of the same scene and simulator."""
        steering, hand = self._steering, hand_record(self._noted_hand)
        return Checkpoint(
            frame=self.frame,
            state=self._solver.snapshot(),
            guidance=None if steering is None else steering.guidance.snapshot(),
            rest={
                "control": None if self._control is None else self._control.model_dump(),
                "steered": self._steered,
                "hand": None if hand is None else hand.model_dump(),
                "safeguard": None if self._recorder is None else self._recorder.values,
            },
        )

    def restore(self, checkpoint: Checkpoint) -> None:
        """Continue from a checkpoint, with the same bits as the simulation that made it.

        Raises
        ------
        SnapshotError
            The checkpoint belongs to another scene, to other settings or to another version.
        """
        rest = checkpoint.rest
        self._solver.restore(checkpoint.state)
        self._forces.clear()
        self._control = None if rest["control"] is None else Control(**rest["control"])
        self._steering = None
        if checkpoint.guidance is not None and self._control is not None:
            guidance = restored(checkpoint.guidance, self.scene)
            self._steering = Steering(self._control.number, guidance, self._solver, self._control)
        self._steered = rest["steered"]
        hand = rest["hand"]
        if hand is None:
            self.hand = self._noted_hand = None
        else:
            self.hand = self._noted_hand = (Grip if "grip" in hand else Hand)(**hand).force()
        if self._recorder is not None and rest["safeguard"] is not None:
            self._recorder.restore(rest["safeguard"])

    def particles(self) -> Particles:
        """Return a copy of the positions, velocities and types."""
        return Particles(
            frame=self._solver.frame,
            time=self._solver.time,
            positions=self._solver.positions,
            velocities=self._solver.velocities,
            types=self._solver.materials,
            ids=self._solver.ids,
            rigid=self._solver.rigid_numbers(),
        )

    def recording(self) -> Recording:
        """Return a recording of the present state alone."""
        return record(self._solver, 0)

    def force(self) -> CellMeans:
        """Return the force of sketch and hand in the next frame, in the mean over cells; nothing changes."""
        force = total_force(self._acting(self.hand), self._solver.ids, self.scene.dim)
        return CellMeans.of_force(self._solver.frame, self._solver.positions, force)

    def pressure(self) -> CellMeans:
        """Return the pressure [Pa] in the mean over cells.

        Raises
        ------
        PressureUnknownError
            A network moves the particles, or may.
        """
        try:
            samples = self._solver.pressure_samples()
        except ConfigError as err:
            raise PressureUnknownError(str(err)) from err
        return CellMeans.of_pressure(self._solver.frame, samples)

    def view(self) -> View:
        """Return the present state for other threads."""
        latest = self._milliseconds[-1] if self._milliseconds else 0.0
        frame = frame_of(self._solver, solver_ms=latest, steered=self._steered)
        return View(
            frame=frame.number,
            time=frame.time,
            particles=len(frame.positions),
            centroid=self._centroid(frame.positions),
            control=self._control,
            last_frame=self._last_frame(frame) if frame.number else None,
            mode=self._solver.mode,
            safeguard=None if self._recorder is None else self._recorder.view(),
            message=FrameMessage(frame),
        )

    @property
    def frame_seconds(self) -> float | None:
        """Time of a frame [s], None before the first. Safe to read while another thread computes.

        It is the lower quartile over the latest frames: other work on the machine makes frames longer, never
        shorter. A scene that grows quieter or busier is followed within some seconds.
        """
        times = self._means_over_steps()
        return times[len(times) // 4] / 1000.0 if times else None

    def forces(self) -> Forces | None:
        """Return the mean forces on walls and obstacles over the latest frames; None where there are none.

        Safe to call while another thread computes.
        """
        return Forces.over(tuple(self._forces.copy()), self.scene.dim)

    def timing(self) -> Timing:
        """Return the present times of frames. Safe to call while another thread computes."""
        times = self._means_over_steps()
        if not times:
            return Timing(0.0, 0.0, 0.0)
        since = self._clock() - _PACE_WINDOW_SECONDS
        recent = sum(moment > since for moment in self._finished.copy())
        p95 = times[min(len(times) - 1, int(0.95 * len(times)))]
        return Timing(statistics.median(times), p95, recent * self._frame_dt / _PACE_WINDOW_SECONDS)

    def _means_over_steps(self) -> list[float]:
        """Return the times of the latest frames [ms], ascending; means over the frames of a step."""
        latest = list(self._milliseconds.copy())
        span = min(self._solver.r_t, len(latest))
        return sorted(statistics.fmean(latest[i : i + span]) for i in range(len(latest) - span + 1) if span)

    def _centroid(self, positions: npt.NDArray[np.float32]) -> tuple[float, ...] | None:
        if not len(positions):
            return None
        mass = self._solver.mass.astype(np.float64)
        return tuple(map(float, mass / mass.sum() @ positions))

    def _last_frame(self, frame: Frame) -> LastFrame:
        report = self._solver.last_frame
        substeps, bound = (None, None) if report is None else (report.substeps, report.bound)
        return LastFrame(substeps=substeps, bound=bound, ms=frame.solver_ms)

    def _one_frame(self) -> None:
        steering = self._steering
        start = self._clock()
        try:
            self._solver.advance(1, self._force())
        except FrameCancelledError:
            raise  # The session is closed; if it is kept, what the tab did acts when it is revived.
        except SimulationError:
            self._forget_promised()
            raise
        end = self._clock()
        if self._recorder is not None:
            self._recorder.note()
        self.computed_seconds += end - start
        self._milliseconds.append(1000.0 * (end - start))
        self._finished.append(end)
        report = self._solver.last_frame
        if report is not None and self._solver.kind == "mpm":
            self._forces.append(report.forces)
        while self._finished[0] < end - _PACE_WINDOW_SECONDS:
            self._finished.popleft()
        self._steered = steering is not None
        if steering is not None:
            self._control = steering.count()
            if self._control.phase == "done":
                self._steering = None

    def _force(self) -> Any:
        """Return the force of sketch and hand in the next frame; note a change of the hand."""
        self._let_promised_act()
        # While a tab is ahead, the hand is that of its frames.
        hand = self._noted_hand if self.behind else self.note_hand()
        if isinstance(hand, Pull):
            hand(self._solver)
        acting = self._acting(hand)
        if len(acting) < 2:
            return acting[0] if acting else None
        return total_force(acting, self._solver.ids, self.scene.dim)

    def _acting(self, hand: Push | Pull | None) -> list[Any]:
        """Return the forces of sketch and hand on particles in the next frame, without absent ones."""
        forces = [] if self._steering is None else [self._steering.force()]
        if isinstance(hand, Push):
            forces.append(hand(self._solver))
        return [force for force in forces if force is not None]

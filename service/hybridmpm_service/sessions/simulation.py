"""One running simulation with its control and its clockwork. Used by one thread at a time.

No HTTP, no asyncio, no threads in here: `Session` adds those.
"""

import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm import Scene
from hybridmpm.control import ControlledTrajectory, Sketch, follow
from hybridmpm.decisions import Mode
from hybridmpm_service.sessions.frames import Frame, encode
from hybridmpm_service.sessions.safeguard_record import Safeguard, SafeguardRecorder
from hybridmpm_service.sessions.solvers import ChosenSolver

Clock = Callable[[], float]
"""Seconds from an arbitrary start, never going back."""

_TIMES_KEPT = 400
_PACE_WINDOW_SECONDS = 1.0


@dataclass(frozen=True)
class Control:
    """A sketch that steers, and how far it has come."""

    kind: Literal["arrow", "ellipse"]
    first_frame: int
    frames_done: int
    frames: int
    force: npt.NDArray[np.float32]
    """External acceleration besides gravity [m/s^2], (D,) where it is one constant, else (frames, N, D).

    Of the planned trajectory nothing else is kept: its positions would fill the memory while a session waits.
    """

    @property
    def next_force(self) -> npt.NDArray[np.float32]:
        """Force of the next frame, (D,) or (N, D) [m/s^2]."""
        return self.force if self.force.ndim == 1 else self.force[self.frames_done]


@dataclass(frozen=True)
class LastFrame:
    """How the latest frame was computed."""

    substeps: int | None
    """Of MPM; None where a network made the frame."""
    bound: str | None
    ms: float


@dataclass(frozen=True)
class Timing:
    """How fast frames come."""

    ms_per_frame: float
    """Median solver time of the latest frames [ms]; 0 before the first.

    With a network, of means over as many frames as one of its steps spans: all its work falls into the first.
    """
    ms_p95: float
    time_scale: float
    """Simulated seconds per second, over the last second."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """What others may see of a simulation, taken at one instant and never changed."""

    frame: int
    time: float
    centroid: tuple[float, ...]
    control: Control | None
    last_frame: LastFrame | None
    mode: Mode
    """Who simulates the next frame."""
    safeguard: Safeguard | None
    """Only of a hybrid session."""
    message: bytes
    """The binary frame for viewers."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Particles:
    """The state of all particles at one instant."""

    frame: int
    time: float
    positions: npt.NDArray[np.float32]
    velocities: npt.NDArray[np.float32]
    types: npt.NDArray[np.uint8]


class Simulation:
    """A simulator that a sketch can steer.

    Parameters
    ----------
    chosen : ChosenSolver
        At frame 0; the simulation's own from now on.
    clock : Clock
    """

    def __init__(self, chosen: ChosenSolver, *, clock: Clock) -> None:
        self._solver = chosen.simulator
        self._recorder = None if chosen.watch is None else SafeguardRecorder(chosen.simulator, chosen.watch)
        self._clock = clock
        self._control: Control | None = None
        self._steered = False
        self._milliseconds: deque[float] = deque(maxlen=_TIMES_KEPT)
        self._finished: deque[float] = deque()
        self._frame_dt = self.scene.frame_dt
        mass = self._solver.mass.astype(np.float64)
        self._weights = mass / mass.sum()

    @property
    def scene(self) -> Scene:
        return self._solver.scene

    @property
    def r_p(self) -> float:
        """Ratio of the particles to those of the scene."""
        return self._solver.r_p

    @property
    def particle_count(self) -> int:
        return self._solver.particle_count

    @property
    def types(self) -> npt.NDArray[np.uint8]:
        return self._solver.materials

    def advance(self, frames: int, go_on: Callable[[], bool] = lambda: True) -> int:
        """Compute frames one by one while `go_on()`; return how many.

        Raises
        ------
        SimulationError
            The state is then the last good one.
        """
        for done in range(frames):
            if not go_on():
                return done
            self._one_frame()
        return frames

    def steer(
        self, sketch: Sketch, frames: int, on_frame: Callable[[], object] | None = None
    ) -> ControlledTrajectory:
        """Plan from the present state; the next `frames` frames follow the plan. Replaces an older one.

        What `on_frame` raises gives the planning up.

        Raises
        ------
        SimulationError
            No plan was found; an older control goes on.
        """
        plan = follow(self._solver, sketch, frames, on_frame=on_frame)
        self._control = Control(sketch.kind, plan.first_frame, 0, frames, plan.force)
        return plan

    def reset(self) -> None:
        """Go back to frame 0, without control."""
        self._solver.reset()
        if self._recorder is not None:
            self._recorder.clear()
        self._control = None
        self._steered = False

    def particles(self) -> Particles:
        """Take positions, velocities and types."""
        return Particles(
            frame=self._solver.frame,
            time=self._solver.time,
            positions=self._solver.positions,
            velocities=self._solver.velocities,
            types=self._solver.materials,
        )

    def look(self) -> View:
        """Take what others may see."""
        positions = self._solver.positions
        frame = Frame(
            number=self._solver.frame,
            time=self._solver.time,
            solver_ms=self._milliseconds[-1] if self._milliseconds else 0.0,
            steered=self._steered,
            positions=positions,
        )
        return View(
            frame=frame.number,
            time=frame.time,
            centroid=tuple(map(float, self._weights @ positions)),
            control=self._control,
            last_frame=self._last_frame(frame) if frame.number else None,
            mode=self._solver.mode,
            safeguard=None if self._recorder is None else self._recorder.look(),
            message=encode(frame),
        )

    def timing(self) -> Timing:
        """Tell how fast frames come at present. Safe to call while another thread computes."""
        latest = list(self._milliseconds.copy())
        if not latest:
            return Timing(0.0, 0.0, 0.0)
        span = min(self._solver.r_t, len(latest))
        times = sorted(statistics.fmean(latest[i : i + span]) for i in range(len(latest) - span + 1))
        since = self._clock() - _PACE_WINDOW_SECONDS
        recent = sum(moment > since for moment in self._finished.copy())
        p95 = times[min(len(times) - 1, int(0.95 * len(times)))]
        return Timing(statistics.median(times), p95, recent * self._frame_dt / _PACE_WINDOW_SECONDS)

    def _last_frame(self, frame: Frame) -> LastFrame:
        report = self._solver.last_frame
        if report is None:
            return LastFrame(None, None, frame.solver_ms)
        return LastFrame(report.substeps, report.bound, frame.solver_ms)

    def _one_frame(self) -> None:
        control = self._control
        start = self._clock()
        self._solver.advance(1, None if control is None else control.next_force)
        end = self._clock()
        if self._recorder is not None:
            self._recorder.note()
        self._milliseconds.append(1000.0 * (end - start))
        self._finished.append(end)
        while self._finished[0] < end - _PACE_WINDOW_SECONDS:
            self._finished.popleft()
        self._steered = control is not None
        if control is not None:
            done = control.frames_done + 1
            self._control = None if done == control.frames else replace(control, frames_done=done)

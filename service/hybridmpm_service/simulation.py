"""One running simulation with its control and its clockwork. Used by one thread at a time.

No HTTP, no asyncio, no threads in here: `Session` adds those.
"""

import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm import MpmSolver, Scene
from hybridmpm.control import ControlledTrajectory, Sketch, follow
from hybridmpm_service.frames import Frame, encode

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
    """(N, D) [m/s^2], the same in every frame."""


@dataclass(frozen=True)
class LastFrame:
    """How the latest frame was computed."""

    substeps: int
    bound: str
    ms: float


@dataclass(frozen=True)
class Timing:
    """How fast frames come."""

    ms_per_frame: float
    """Median solver time of the latest frames [ms]; 0 before the first."""
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
    """A solver that a sketch can steer.

    Parameters
    ----------
    scene : Scene
    threads : int
        Of the solver; the result does not depend on it.
    clock : Clock

    Raises
    ------
    ConfigError
        The scene cannot be filled with particles.
    """

    def __init__(self, scene: Scene, *, threads: int, clock: Clock) -> None:
        self._solver = MpmSolver(scene, threads=threads)
        self._clock = clock
        self._control: Control | None = None
        self._steered = False
        self._milliseconds: deque[float] = deque(maxlen=_TIMES_KEPT)
        self._finished: deque[float] = deque()
        self._frame_dt = scene.frame_dt

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
        self._control = Control(sketch.kind, plan.first_frame, 0, frames, plan.force())
        return plan

    def reset(self) -> None:
        """Go back to frame 0, without control."""
        self._solver.reset()
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
        report = self._solver.last_frame
        ms = self._milliseconds[-1] if self._milliseconds else 0.0
        frame = Frame(
            number=self._solver.frame,
            time=self._solver.time,
            solver_ms=ms,
            steered=self._steered,
            positions=self._solver.positions,
        )
        return View(
            frame=frame.number,
            time=frame.time,
            centroid=tuple(self._solver.diagnostics().centroid),
            control=self._control,
            last_frame=LastFrame(report.substeps, report.bound, ms) if report and frame.number else None,
            message=encode(frame),
        )

    def timing(self) -> Timing:
        """Tell how fast frames come at present. Safe to call while another thread computes."""
        times = sorted(self._milliseconds.copy())
        if not times:
            return Timing(0.0, 0.0, 0.0)
        since = self._clock() - _PACE_WINDOW_SECONDS
        recent = sum(moment > since for moment in self._finished.copy())
        p95 = times[min(len(times) - 1, int(0.95 * len(times)))]
        return Timing(statistics.median(times), p95, recent * self._frame_dt / _PACE_WINDOW_SECONDS)

    def _one_frame(self) -> None:
        control = self._control
        start = self._clock()
        self._solver.advance(1, force=None if control is None else control.force)
        end = self._clock()
        self._milliseconds.append(1000.0 * (end - start))
        self._finished.append(end)
        while self._finished[0] < end - _PACE_WINDOW_SECONDS:
            self._finished.popleft()
        self._steered = control is not None
        if control is not None:
            done = control.frames_done + 1
            ended = done == control.frames
            self._control = (
                None
                if ended
                else Control(control.kind, control.first_frame, done, control.frames, control.force)
            )

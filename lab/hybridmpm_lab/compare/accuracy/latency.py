"""Latency of simulators, call by call and by turns, so that a busy machine slows down all of them alike."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track, warmup_frames
from hybridmpm.planner.calibrating.impact import first_frame
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm.simulator import Simulator
from hybridmpm_lab.harness.rows import Row, significant
from hybridmpm_lab.harness.timing import Clock

_TURN = 10
"""Frames that a simulator goes on in one turn."""
_LEAST_CALLS = 3
"""Calls of each simulator, however long they take."""


@dataclass(frozen=True, kw_only=True)
class Latency:
    """Time from a call of a simulator to its answer [ms]."""

    median: float
    """Median time of a frame."""
    p95: float
    """95th percentile of the time of a frame."""
    per_call: float
    """Median time of a call, which a live session has to wait for."""

    @classmethod
    def of(cls, times: Sequence[float], frames: int) -> Self | None:
        """Take percentiles over calls; None where there are fewer than three.

        Parameters
        ----------
        times : sequence of float
            Time of each call [s].
        frames : int
            Frames of each call.
        """
        if len(times) < _LEAST_CALLS:
            return None
        per_frame = 1e3 * np.array(times) / frames
        median = float(np.median(per_frame))
        return cls(median=median, p95=float(np.percentile(per_frame, 95)), per_call=median * frames)


def latency_fields(latency: Latency | None) -> Row:
    """Return the fields `ms_per_frame`, `ms_p95` and `ms_per_call` of a row [ms]; None where unknown."""
    return {
        "ms_per_frame": significant(latency.median if latency else None),
        "ms_p95": significant(latency.p95 if latency else None),
        "ms_per_call": significant(latency.per_call if latency else None),
    }


class Timing:
    """A simulator and the times of its calls.

    Parameters
    ----------
    simulator : Simulator
    frames_per_call : int
        Frames that the simulator computes at once: r_t for a network.
    """

    def __init__(self, simulator: Simulator, frames_per_call: int = 1) -> None:
        self.simulator = simulator
        self._frames = frames_per_call
        self._seconds: list[float] = []
        self._failed = False

    def restart(self, frame: int) -> None:
        """Reset the simulator and bring it to a frame, without timing."""
        self.simulator.reset()
        try:
            self.simulator.advance(frame)
        except SimulationError:
            self._failed = True

    def reach(self, frame: int, seconds: float) -> None:
        """Bring the simulator on to a frame and time each call, until `enough` calls are timed."""
        while self.simulator.frame < frame and not self.enough(seconds):
            try:
                with Clock(self._seconds):
                    self.simulator.advance(self._frames)
            except SimulationError:
                self._failed = True

    def enough(self, seconds: float) -> bool:
        """Whether the simulator failed, or was called three times or more and for longer than `seconds`."""
        return self._failed or _enough(self._seconds, seconds)

    def latency(self) -> Latency | None:
        """Return percentiles over the calls; None where the simulator failed before the third call."""
        return Latency.of(self._seconds, self._frames)


def latencies_by_turns(
    timings: Sequence[Timing], *, start: int, span: int, passes: int, seconds: float
) -> list[Latency | None]:
    """Time the calls of several simulators over the same frames of a rollout, by turns.

    Parameters
    ----------
    timings : sequence of Timing
    start : int
        Frame before the first that is timed; it is not before the end of any warm-up.
    span : int
        Number of frames that are timed.
    passes : int
        Number of rollouts.
    seconds : float
        Time of calls [s] after which a simulator is not called again.
    """
    for _ in range(passes):
        for timing in timings:
            if not timing.enough(seconds):
                timing.restart(start)
        for stop in range(start + _TURN, start + span + 1, _TURN):
            for timing in timings:
                timing.reach(stop, seconds)
    return [timing.latency() for timing in timings]


def step_latency(
    stepper: Stepper, scene: Scene, *, earliest: int, span: int, threads: int, seconds: float
) -> tuple[Latency | None, Latency | None]:
    """Time single steps of a network on states of MPM, so that the weights do not change the cost.

    Parameters
    ----------
    stepper : Stepper
    scene : Scene
    earliest, span : int
        Steps begin, evenly spread, in the `span` frames after `first_frame(scene, earliest)`.
    threads : int
        Threads of MPM.
    seconds : float
        Time for the steps beyond the first three [s].

    Returns
    -------
    Latency or None
        Latency of a whole step, the frames within it included.
    Latency or None
        Latency of MPM with all particles, timed by turns with the steps: a measure of the machine's speed at
        that time.
    """
    start = first_frame(scene, earliest)
    states = record(MpmSolver(scene, r_p=stepper.r_p), start + span)
    yardstick = Timing(MpmSolver(scene, threads=threads))
    yardstick.restart(start)
    _step_seconds(stepper, states, start)
    times: list[float] = []
    for frame in range(start + _TURN, start + span + 1, _TURN):
        yardstick.reach(frame, seconds)
        if not _enough(times, seconds):
            times.append(_step_seconds(stepper, states, frame))
    return Latency.of(times, stepper.r_t), yardstick.latency()


def _step_seconds(stepper: Stepper, states: Recording, frame: int) -> float:
    """Time a step of a network that begins at a frame of a recording of every frame."""
    track = Track(stepper, states.scene, states.types)
    for positions in states.positions[frame - warmup_frames(stepper.r_t) : frame + 1 : stepper.r_t]:
        track.observe(positions)
    began = time.perf_counter()
    track.begin(track.predict())
    for _ in range(stepper.r_t):
        track.tick()
        _ = track.positions
    track.arrive()
    return time.perf_counter() - began


def _enough(times: Sequence[float], seconds: float) -> bool:
    return len(times) >= _LEAST_CALLS and sum(times) > seconds

"""`follow`: let a simulator follow a sketch, frame by frame."""

from collections.abc import Callable, Iterator
from collections.abc import Sequence as Several
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import EARTH, Floats
from hybridmpm.control.goal.goal import Goal
from hybridmpm.control.goal.region import NEAR
from hybridmpm.control.guidance import SketchOptions
from hybridmpm.control.keyframes import Given, Keyframe, Led, Sequence, plan_motion, restored
from hybridmpm.control.laws import Floats32, is_whole
from hybridmpm.control.methods.method import Method
from hybridmpm.control.sketch.sketch import Sketch
from hybridmpm.control.trajectory import ControlledTrajectory, Ending, SketchResult
from hybridmpm.errors import ConfigError
from hybridmpm.force import total_force
from hybridmpm.simulator import Simulator


@dataclass(frozen=True, eq=False)
class ControlledFrame:
    """One frame of a simulator that follows a sketch."""

    frame: int
    """Frame number of the simulator, after the frame."""
    positions: npt.NDArray[np.float32]
    """Positions (N, D) [m] of the particles that are led; NaN where gone."""
    force: npt.NDArray[np.float32]
    """Acceleration besides gravity that acted on them, (D,) or (N, D) [m/s^2]."""


class Following(Iterator[ControlledFrame]):
    """A simulator that follows a sketch. Each step of the iteration computes one frame.

    Between two steps the simulator may be read, saved or paused. To advance, reset or restore it elsewhere,
    e.g. by following another sketch, ends this iteration: it is then superseded.

    Parameters
    ----------
    simulator : Simulator
        Advanced by the iteration. At `guidance.first_frame`, or later after a snapshot.
    guidance : Guidance or Sequence
        Made for this simulator's scene.

    Raises
    ------
    ConfigError
        The simulator is not within the frames of the guidance.
    """

    def __init__(self, simulator: Simulator, guidance: Led) -> None:
        last = guidance.first_frame + guidance.total_frames
        if not guidance.first_frame <= simulator.frame <= last:
            raise ConfigError(
                f"the guidance is for the frames {guidance.first_frame} to {last}, and the simulator is at "
                f"frame {simulator.frame}: prepare it anew"
            )
        self.guidance = guidance
        """Goal, law and needs, of one goal or of several."""
        self.simulator = simulator
        """The simulator that follows."""
        self._ids, self._weight = guidance.ids, guidance.weight
        self._expected = simulator.frame
        self._start = simulator.frame
        self._cancelled = False
        self._ending: Ending | None = None
        self._positions = [self.placed(simulator.positions)]
        self._forces: list[Floats32] = []
        self._passed: list[SketchResult] = []

    def __repr__(self) -> str:
        last = self.guidance.first_frame + self.guidance.total_frames
        progress = f"{self.frames_done} of {last - self._start} frames"
        guidance = self.guidance
        what = f"{len(guidance.legs)} keyframes" if isinstance(guidance, Sequence) else guidance.sketch.kind
        return f"Following({self.simulator!r}, {what}, {progress})"

    @property
    def frames_done(self) -> int:
        """Number of frames that were computed."""
        return len(self._forces)

    @property
    def ending(self) -> Ending | None:
        """Reason of the end; None as long as there are frames to come."""
        return self._ending

    def cancel(self) -> None:
        """End before the next frame; the simulator stays where it is. Safe to call from another thread."""
        self._cancelled = True

    def __next__(self) -> ControlledFrame:
        """Compute a frame.

        Raises
        ------
        SimulationError
            The frame failed; the state is the one before it, and this was the last frame.
        """
        if self._ending is None:
            self._ending = self._end_before_next()
        if self._ending is not None:
            raise StopIteration
        simulator = self.simulator
        # The law itself: what it keeps on its way is that of this run.
        force = self.guidance(simulator)
        try:
            simulator.advance(1, force)
        except BaseException:
            self._ending = "failed"
            raise
        self._expected = simulator.frame
        self._forces.append(self._force_of_all(force))
        self._positions.append(self.placed(simulator.positions))
        self._note_passed()
        return ControlledFrame(simulator.frame, self._positions[-1], self._forces[-1])

    def edit(self, keyframes: Several[Given]) -> None:
        """Follow other keyframes from the present state on, with the same options.

        The present velocities are kept, so the motion goes on without a jump. `left` returns the keyframes
        that are left, to change one of them.

        Raises
        ------
        ConfigError
            A single sketch is followed, or all frames are over; or as of `prepare_keyframes`.
        SketchError
            As of `prepare_keyframes`; what is followed stays as it was.
        """
        if not isinstance(self.guidance, Sequence):
            raise ConfigError("one sketch is followed, and only keyframes can be edited: follow it anew")
        if self._ending is not None or self._end_before_next() is not None:
            raise ConfigError("the keyframes are over: follow new ones")
        self.guidance = self.guidance.edited(self.simulator, keyframes)

    @property
    def left(self) -> list[Keyframe]:
        """The keyframes that are left, the present one with the frames that it has left; [] for a sketch."""
        if not isinstance(self.guidance, Sequence) or self._end_before_next() is not None:
            return []
        return self.guidance.left(self.simulator.frame - self.guidance.first_frame)

    def run(self) -> ControlledTrajectory:
        """Compute all frames that are left, and return the result."""
        for _ in self:
            pass
        return self.result

    @property
    def result(self) -> ControlledTrajectory:
        """The result, once the iteration has ended.

        Raises
        ------
        ConfigError
            There are frames to come.
        """
        if self._ending is None:
            raise ConfigError("the result is there at the end: iterate to it, or call run() or cancel()")
        return self._result(self._ending)

    def snapshot(self) -> bytes:
        """Return the bytes from which `resume` continues, together with the simulator's own snapshot."""
        return self.guidance.snapshot()

    def placed(self, values: Floats32) -> Floats32:
        """Give rows (M, D), one for each present particle of the simulator, to the particles of the start.

        Returns (N, D), with NaN for particles that are gone. Where all are led and none come or go, these are
        the same rows.
        """
        simulator, ids = self.simulator, self._ids
        if is_whole(simulator, len(ids)):
            return values
        placed = np.full((len(ids), simulator.dim), np.nan, dtype=np.float32)
        present = simulator.ids
        known = np.isin(present, ids)
        placed[np.searchsorted(ids, present[known])] = values[known]
        return placed

    def _end_before_next(self) -> Ending | None:
        if self.simulator.frame != self._expected:
            return "superseded"
        if self._expected >= self.guidance.first_frame + self.guidance.total_frames:
            return "done"
        return "cancelled" if self._cancelled else None

    def _force_of_all(self, force: Any) -> Floats32:
        dim = self.simulator.dim
        if force is None:
            return np.zeros(dim, dtype=np.float32)
        if not isinstance(force, tuple):
            return np.asarray(force)
        return total_force([force], self._ids, dim)

    def _result(self, ending: Ending) -> ControlledTrajectory:
        weight, dim = self._weight, self.simulator.dim
        goal = self.guidance.goal
        positions = np.stack(self._positions)
        centroids = np.array([_mean(weight, x) for x in positions])
        force = _joined(self._forces, dim)
        mean_force = np.array(
            [one if one.ndim == 1 else weight @ one for one in self._forces], dtype=np.float64
        ).reshape(-1, dim)
        return ControlledTrajectory(
            ids=self._ids,
            positions=positions,
            force=force,
            mean_force=mean_force,
            target_displacement=goal.target_displacement,
            displacement=centroids[-1] - centroids[0],
            centroids=centroids,
            first_frame=self._start,
            reached=self._reached(self.guidance.goal, *self._span()),
            passed=tuple(self._passed),
            ending=ending,
        )

    def _span(self) -> tuple[int, int]:
        """Return the first frame of the present goal and the one at its end, counted from the start."""
        guidance, first = self.guidance, self.guidance.first_frame - self._start
        begin, end = first, first + guidance.frames
        if isinstance(guidance, Sequence):
            leg = guidance.legs[guidance.number]
            begin, end = first + leg.start, first + leg.arrival
        return max(begin, 0), min(max(end, 0), len(self._forces))

    def _note_passed(self) -> None:
        """Note how near the simulator came to a goal of several, in the frame in which it is passed."""
        if isinstance(self.guidance, Sequence):
            begin, end = self._span()
            leg = self.guidance.legs[self.guidance.number]
            if self.guidance.first_frame - self._start + leg.arrival == len(self._forces):
                self._passed.append(self._reached(self.guidance.goal, begin, end))

    def _reached(self, goal: Goal, begin: int, end: int) -> SketchResult:
        known = np.isin(goal.cloud.ids, self._ids)
        weight = goal.cloud.weight[known]
        rows = np.searchsorted(self._ids, goal.cloud.ids[known])
        x = self._positions[end][rows].astype(np.float64)
        there = np.isfinite(x).all(axis=1)

        def share(inside: npt.NDArray[np.bool_] | None) -> float | None:
            return None if inside is None else float(weight[there] @ inside)

        forces = [one if one.ndim == 1 else one[rows] for one in self._forces[begin:]]
        square = [
            float(weight @ (one**2).sum(axis=-1)) if one.ndim == 2 else float(one @ one) for one in forces
        ]
        largest = [float((one**2).sum(axis=-1).max()) for one in forces]
        return SketchResult(
            inside=share(goal.inside(x[there])),
            inside_drawn=share(goal.inside_drawn(x[there])),
            miss=float(np.linalg.norm(_mean(weight, x) - goal.path[-1])),
            rms=float(np.sqrt(np.mean(square[: end - begin]))) / EARTH if end > begin else 0.0,
            peak=float(np.sqrt(max(largest, default=0.0))) / EARTH,
            near=NEAR * goal.room.unit,
            fills=self.guidance.method != "learned",
        )


def follow(
    simulator: Simulator,
    sketch: Sketch | Several[Given],
    method: str | Method = "auto",
    *,
    on_frame: Callable[[], object] | None = None,
    **options: Unpack[SketchOptions],
) -> Following:
    """Let a simulator follow a sketch, or several in turn. Each step of the iteration computes a frame.

    Several are keyframes, `[(goal, frames), ...]` or `Keyframe` with `hold` and `who`, and planned as one
    motion; see `prepare_keyframes`.
    `for frame in follow(simulator, sketch): ...` shows each frame as soon as it is computed;
    `follow(simulator, sketch).run()` computes them all. A hybrid simulator follows by MPM, because of the
    force, and returns to the network afterwards by its own rules.

    Parameters, including `options`, and errors are those of `prepare`.
    """
    return Following(simulator, plan_motion(simulator, sketch, method, on_frame=on_frame, **options))


def resume(simulator: Simulator, data: bytes) -> Following:
    """Continue to follow a sketch from snapshots, to the same bits as without the interruption.

    Parameters
    ----------
    simulator : Simulator
        Restored from its own snapshot.
    data : bytes
        From `Following.snapshot` or `Guidance.snapshot`.

    Raises
    ------
    SnapshotError
        `data` is damaged or no snapshot of a guidance.
    ConfigError
        The simulator is not within the frames of the guidance.
    """
    return Following(simulator, restored(data, simulator.scene))


def _mean(weight: Floats, x: Floats32 | Floats) -> Floats:
    """Return the mean (D,) over the mass of those particles that are still there."""
    there = np.isfinite(x).all(axis=1)
    if there.all():
        return np.asarray(weight @ x)
    return np.asarray(weight[there] @ x[there] / max(float(weight[there].sum()), 1e-30))


def _joined(forces: list[Floats32], dim: int) -> Floats32:
    """Return (D,) if all forces are the same constant, else (T, N, D)."""
    if not forces:
        return np.zeros(dim, dtype=np.float32)
    if all(one.ndim == 1 and np.array_equal(one, forces[0]) for one in forces):
        return forces[0]
    return np.stack(forces)

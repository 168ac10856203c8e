"""`follow`: let a simulator follow a sketch, frame by frame."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import EARTH, Floats
from hybridmpm.control.goal.region import NEAR
from hybridmpm.control.guidance import Guidance, SketchOptions, prepare
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
    guidance : Guidance
        Made for this simulator's scene.

    Raises
    ------
    ConfigError
        The simulator is not within the frames of the guidance.
    """

    def __init__(self, simulator: Simulator, guidance: Guidance) -> None:
        last = guidance.first_frame + guidance.total_frames
        if not guidance.first_frame <= simulator.frame <= last:
            raise ConfigError(
                f"the guidance is for the frames {guidance.first_frame} to {last}, and the simulator is at "
                f"frame {simulator.frame}: prepare it anew"
            )
        self.guidance = guidance
        """Goal, law and needs."""
        self.simulator = simulator
        """The simulator that follows."""
        self._expected = simulator.frame
        self._start = simulator.frame
        self._cancelled = False
        self._ending: Ending | None = None
        self._positions = [self.placed(simulator.positions)]
        self._forces: list[Floats32] = []

    def __repr__(self) -> str:
        progress = f"{self.frames_done} of {self.guidance.total_frames} frames"
        return f"Following({self.simulator!r}, {self.guidance.sketch.kind}, {progress})"

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
        force = self.guidance(simulator)
        try:
            simulator.advance(1, force)
        except BaseException:
            self._ending = "failed"
            raise
        self._expected = simulator.frame
        self._forces.append(self._force_of_all(force))
        self._positions.append(self.placed(simulator.positions))
        return ControlledFrame(simulator.frame, self._positions[-1], self._forces[-1])

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
        simulator, ids = self.simulator, self.guidance.goal.cloud.ids
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
        cloud = self.guidance.goal.cloud
        if force is None:
            return np.zeros(cloud.dim, dtype=np.float32)
        if not isinstance(force, tuple):
            return np.asarray(force)
        return total_force([force], cloud.ids, cloud.dim)

    def _result(self, ending: Ending) -> ControlledTrajectory:
        goal = self.guidance.goal
        weight = goal.cloud.weight
        positions = np.stack(self._positions)
        centroids = np.array([_mean(weight, x) for x in positions])
        force = _joined(self._forces, goal.cloud.dim)
        mean_force = np.array(
            [one if one.ndim == 1 else weight @ one for one in self._forces], dtype=np.float64
        ).reshape(-1, goal.cloud.dim)
        return ControlledTrajectory(
            ids=goal.cloud.ids,
            positions=positions,
            force=force,
            mean_force=mean_force,
            target_displacement=goal.target_displacement,
            displacement=centroids[-1] - centroids[0],
            centroids=centroids,
            first_frame=self._start,
            reached=self._reached(positions, centroids),
            ending=ending,
        )

    def _reached(self, positions: Floats32, centroids: Floats) -> SketchResult:
        goal, guidance = self.guidance.goal, self.guidance
        weight = goal.cloud.weight
        end = min(max(guidance.first_frame + guidance.frames - self._start, 0), len(positions) - 1)
        x = positions[end].astype(np.float64)
        there = np.isfinite(x).all(axis=1)

        def share(inside: npt.NDArray[np.bool_] | None) -> float | None:
            return None if inside is None else float(weight[there] @ inside)

        square = [
            float(weight @ (one**2).sum(axis=-1)) if one.ndim == 2 else float(one @ one)
            for one in self._forces
        ]
        largest = [float((one**2).sum(axis=-1).max()) for one in self._forces]
        return SketchResult(
            inside=share(goal.inside(x[there])),
            inside_drawn=share(goal.inside_drawn(x[there])),
            miss=float(np.linalg.norm(centroids[end] - goal.path[-1])),
            rms=float(np.sqrt(np.mean(square[:end]))) / EARTH if end else 0.0,
            peak=float(np.sqrt(max(largest, default=0.0))) / EARTH,
            near=NEAR * goal.room.unit,
        )


def follow(
    simulator: Simulator,
    sketch: Sketch,
    method: str | Method = "auto",
    *,
    on_frame: Callable[[], object] | None = None,
    **options: Unpack[SketchOptions],
) -> Following:
    """Let a simulator follow a sketch. It is advanced as the result is iterated, one frame a step.

    `for frame in follow(simulator, sketch): ...` shows each frame as soon as it is computed;
    `follow(simulator, sketch).run()` computes them all. A hybrid simulator follows by MPM, because of the
    force, and returns to the network afterwards by its own rules.

    Parameters, including `options`, and errors are those of `prepare`.
    """
    return Following(simulator, prepare(simulator, sketch, method, on_frame=on_frame, **options))


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
    return Following(simulator, Guidance.restored(data, simulator.scene))


def _mean(weight: Floats, x: Floats32) -> Floats:
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

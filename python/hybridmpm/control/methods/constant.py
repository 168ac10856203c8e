"""The paper's baseline controller: one acceleration, the same for all particles and all frames.

The first guess is exact for a body in free flight. Walls, obstacles and the fluid's own pressure also act on
the motion, so the guess is corrected by trials: copies of the simulator are run, and each miss corrects the
next acceleration.
"""

from dataclasses import dataclass

import numpy as np

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.laws import Floats32, Uniform, is_whole
from hybridmpm.control.methods.method import Task
from hybridmpm.errors import FrameCancelledError, SimulationError
from hybridmpm.simulator import Simulator

MAX_ACCELERATION = 100.0
"""Largest constant acceleration [m/s^2], about ten times gravity.

A target that needs more is out of reach in the given frames; more would only press the fluid through walls.
"""
MAX_ROLLOUTS = 5
"""Largest number of accelerations tried for one sketch."""
_ALLOWED_MISS = 0.01
"""Shooting ends when the miss is below this fraction of the target displacement [-]."""
_SMALLEST_MISS = 1e-3
"""Shooting also ends when the miss is below this part of the longest side of the world [-]."""
_MAX_USELESS = 2
"""Shooting ends after this many rollouts without progress: a wall is in the way, and no force moves it."""


class Constant:
    """Finds the constant acceleration under which the centre of mass goes where the sketch leads.

    A body in free flight needs a = 2 (Delta - v_0 t) / t^2 - g, where Delta is the displacement of the
    sketch, v_0 the velocity of the centre of mass and t the time. This acceleration is tried on a
    copy of the simulator, and the miss gives the next acceleration (Broyden's method). Up to `MAX_ROLLOUTS`
    accelerations are tried; the one with the smallest miss is taken. Accelerations longer than
    `MAX_ACCELERATION` or the cap of the task are shortened to that.

    With an arrow the centre of mass is to move by tip minus tail, with an oval to its centre. A network alone
    gets the acceleration as an input.

    References
    ----------
    The baseline of the control experiments of arXiv:2505.18926. The paper leaves open how the acceleration is
    found.
    """

    name = "constant"

    def plan(self, simulator: Simulator, task: Task) -> Uniform:
        """Return the law with the acceleration that misses least.

        Raises
        ------
        SimulationError
            The simulator failed under every acceleration tried; this is the last failure.
        """
        cloud = task.goal.cloud
        goal = task.goal
        target = goal.target_displacement if goal.drawn is None else goal.drawn.center - cloud.centroid
        seconds = task.frames * cloud.frame_dt
        search = _Shooting(simulator, task, target)
        trial = search.limited(2 * (target - cloud.mean_velocity * seconds) / seconds**2 - cloud.gravity)
        gain = np.eye(cloud.dim) * seconds**2 / 2
        return Uniform(search.run(trial, gain), cloud.ids)


@dataclass(frozen=True, eq=False)
class _Shot:
    """One acceleration and what it did."""

    applied: Floats32
    displacement: Floats

    @property
    def acceleration(self) -> Floats:
        return self.applied.astype(np.float64)


class _Shooting:
    """Tries accelerations on copies of the simulator and keeps the one with the smallest miss."""

    def __init__(self, simulator: Simulator, task: Task, target: Floats) -> None:
        self._simulator = simulator
        self._task = task
        self._target = target
        self._largest = min(MAX_ACCELERATION, task.cap_si)

    def run(self, trial: Floats, gain: Floats) -> Floats32:
        """Return the acceleration (D,) [m/s^2] with the smallest miss.

        `trial` is the first acceleration (D,) [m/s^2]; `gain` (D, D) [s^2] is the first guess of the
        derivative of the displacement by the acceleration.
        """
        smallest_miss = _SMALLEST_MISS * self._task.goal.room.unit
        good_enough = max(smallest_miss, _ALLOWED_MISS * float(np.linalg.norm(self._target)))
        best: _Shot | None = None
        last: _Shot | None = None
        smallest, useless = np.inf, 0
        failures: list[SimulationError] = []
        for _ in range(MAX_ROLLOUTS):
            try:
                shot = self._rollout(trial)
            except FrameCancelledError:
                raise
            except SimulationError as err:
                failures.append(err)
                # Halfway back to an acceleration that works: the best one so far, else none at all.
                trial = (trial + (0.0 if best is None else best.acceleration)) / 2
                continue
            if last is not None:
                gain = _broyden(gain, shot, last)
            last = shot
            miss = self._target - shot.displacement
            size = float(np.linalg.norm(miss))
            if size < smallest:
                useless = 0 if size < 0.9 * smallest else useless + 1
                best, smallest = shot, size
            else:
                useless += 1
            if smallest <= good_enough or useless >= _MAX_USELESS:
                break
            # `rcond` leaves out directions without gain: there a wall stops all motion.
            correction = np.asarray(np.linalg.lstsq(gain, miss, rcond=0.05)[0], dtype=np.float64)
            trial = self.limited(shot.acceleration + self.limited(correction))
        if best is None:
            raise failures[-1]
        return best.applied

    def limited(self, acceleration: Floats) -> Floats:
        """Shorten an acceleration (D,) [m/s^2] to the largest that is allowed."""
        size = float(np.linalg.norm(acceleration))
        return acceleration * min(1.0, self._largest / max(size, 1e-12))

    def _rollout(self, acceleration: Floats) -> _Shot:
        # Rounded here once, so that the acceleration that was tried is exactly the one that is applied.
        law = Uniform(acceleration.astype(np.float32), self._task.goal.cloud.ids)
        twin = self._simulator.copy()
        for index in range(self._task.frames):
            self._task.on_frame()
            twin.advance(1, law.force(twin, index))
        return _Shot(law.acceleration, self._centroid(twin) - self._task.goal.cloud.centroid)

    def _centroid(self, twin: Simulator) -> Floats:
        cloud = self._task.goal.cloud
        if is_whole(twin, len(cloud.ids)):
            return np.asarray(cloud.weight @ twin.positions)
        there = np.isin(twin.ids, cloud.ids)
        mass = twin.mass[there].astype(np.float64)
        return np.asarray(mass @ twin.positions[there] / max(mass.sum(), 1e-30))


def _broyden(gain: Floats, shot: _Shot, last: _Shot) -> Floats:
    """Return the gain that also explains the latest pair of (acceleration, displacement)."""
    step = shot.acceleration - last.acceleration
    surprise = shot.displacement - last.displacement - gain @ step
    return np.asarray(gain + np.outer(surprise, step) / max(float(step @ step), 1e-12))

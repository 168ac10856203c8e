"""The paper's baseline controller: one acceleration, the same for all particles and all frames.

The first guess is exact for a body in free flight. Walls, obstacles and the fluid's own pressure also act on
the motion, so the guess is corrected by shooting: copies of the solver are run, and each miss corrects the
next acceleration.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.control.sketch.sketch import Arrow, Floats, Sketch, depth_of_width
from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm.simulator import Simulator

MAX_FRAMES = 10_000
MAX_ACCELERATION = 100.0
"""Largest control acceleration [m/s^2], about ten times gravity.

A target that needs more is out of reach in the given frames; more would only press the fluid through walls.
"""
MAX_ROLLOUTS = 5
"""Largest number of accelerations tried for one sketch."""
_ALLOWED_MISS = 0.01
"""Shooting ends when the miss is below this fraction of the target displacement [-]."""
_SMALLEST_MISS = 1e-3
"""Shooting also ends when the miss is below this length [m]."""
_MAX_USELESS = 2
"""Shooting ends after this many rollouts without progress: a wall is in the way, and no force moves it."""


@dataclass(frozen=True, eq=False)
class ControlledTrajectory:
    """Motion of a scene's particles under the force that follows a sketch.

    N is the number of particles, D the dimension, T the number of frames.
    """

    positions: npt.NDArray[np.float32]
    """Positions (T + 1, N, D) [m]; row 0 is the state at the start."""
    force: npt.NDArray[np.float32]
    """External acceleration besides gravity [m/s^2], in the form that `Simulator.advance` takes over T
    frames: (D,) where it is one constant, else (T, N, D)."""
    mean_force: Floats
    """Mean of `force` over the mass of the particles, in each frame, (T, D) [m/s^2]."""
    target_displacement: Floats
    """Displacement of the centre of mass that the sketch asks for, (D,) [m]."""
    displacement: Floats
    """Displacement of the centre of mass over the T frames, (D,) [m]."""
    centroids: Floats
    """Centre of mass at the start and after each frame, (T + 1, D) [m]."""
    first_frame: int
    """Frame number of the solver at the start."""

    @property
    def frames(self) -> int:
        """Number T of frames."""
        return len(self.positions) - 1

    def force_at(self, index: int) -> npt.NDArray[np.float32]:
        """Return the force (D,) or (N, D) [m/s^2] of a frame; the first frame has `index` 0.

        `solver.advance(T, trajectory.force)` from the state at the start gives `positions` bit for bit, and
        so does `solver.advance(1, trajectory.force_at(index))` for each frame in turn.
        """
        return self.force if self.force.ndim == 1 else self.force[index]


def follow(
    solver: Simulator,
    sketch: Sketch,
    frames: int = 100,
    *,
    on_frame: Callable[[], object] | None = None,
) -> ControlledTrajectory:
    """Find the constant acceleration under which the centre of mass follows a sketch.

    A body in free flight needs a = 2 (Delta - v_0 t) / t^2 - g, where Delta is the displacement that the
    sketch asks for, v_0 the velocity of the centre of mass and t the time. This acceleration is tried on a
    copy of the solver, and the miss gives the next acceleration (Broyden's method). Up to `MAX_ROLLOUTS`
    accelerations are tried; the trajectory with the smallest miss is returned. Accelerations longer than
    `MAX_ACCELERATION` are shortened to it.

    Parameters
    ----------
    solver : Simulator
        Simulator in the state that the sketch was drawn on; it does not change. A hybrid simulator follows
        the sketch by MPM, because of the force. A network alone gets the acceleration as an input.
    sketch : Arrow or Ellipse
        An arrow asks the centre of mass to move by tip minus tail, an ellipse to move to its centre. In 3D
        the widths of the stroke give the depth; without widths the depth does not change.
    frames : int in [1, 10000]
        Number T of frames.
    on_frame : callable, optional
        Called before each frame of each trial. An exception from it ends the search, except a
        SimulationError, which ends the trial.

    Raises
    ------
    ConfigError
        `frames` is out of range, or the scene has emitters or sinks: particles that come and go would move
        the centre of mass.
    SimulationError
        The solver failed under every acceleration tried; this is the last failure.

    References
    ----------
    The baseline of the control experiments of arXiv:2505.18926. The paper leaves open how the acceleration is
    found.
    """
    frames = whole("frames", frames, 1, MAX_FRAMES)
    scene = solver.scene
    if scene.is_open:
        raise ConfigError("a scene with emitters or sinks cannot be steered: its particles come and go")
    velocity = _mean(solver, solver.velocities)
    target = target_displacement(sketch, solver)
    seconds = frames * scene.frame_dt
    gain = np.eye(solver.dim) * seconds**2 / 2
    shot = _Shooting(solver, target, frames, on_frame or (lambda: None))
    trial = _limited(2 * (target - velocity * seconds) / seconds**2 - np.array(scene.gravity))
    return shot.run(trial, gain)


def target_displacement(sketch: Sketch, solver: Simulator) -> Floats:
    """Return how far a sketch asks the present centre of mass to move, (D,) [m]."""
    centroid = _mean(solver, solver.positions)
    front = sketch.displacement if isinstance(sketch, Arrow) else sketch.center - centroid[:2]
    if solver.dim == 2:
        return np.array(front)
    walls = solver.scene.walls
    back_z, front_z = walls.lower[2], walls.upper[2]
    depth = 0.0
    if isinstance(sketch, Arrow):
        if sketch.widths is not None:
            start, end = (depth_of_width(float(sketch.widths[i]), back_z, front_z) for i in (0, -1))
            depth = end - start
    elif sketch.width is not None:
        depth = depth_of_width(sketch.width, back_z, front_z) - float(centroid[2])
    return np.append(front, depth)


class _Shooting:
    """Tries accelerations on copies of the solver and keeps the result with the smallest miss."""

    def __init__(
        self, solver: Simulator, target: Floats, frames: int, on_frame: Callable[[], object]
    ) -> None:
        self._solver = solver
        self._target = target
        self._frames = frames
        self._on_frame = on_frame
        self._weights = _weights(solver)

    def run(self, trial: Floats, gain: Floats) -> ControlledTrajectory:
        """Return the trajectory with the smallest miss.

        `trial` is the first acceleration (D,) [m/s^2]; `gain` (D, D) [s^2] is the first guess of the
        derivative of the displacement by the acceleration.
        """
        good_enough = max(_SMALLEST_MISS, _ALLOWED_MISS * float(np.linalg.norm(self._target)))
        best: ControlledTrajectory | None = None
        smallest, useless = np.inf, 0
        last: tuple[Floats, Floats] | None = None
        failures: list[SimulationError] = []
        for _ in range(MAX_ROLLOUTS):
            try:
                result = self._rollout(trial)
            except SimulationError as err:
                failures.append(err)
                # Halfway back to an acceleration that works: the best one so far, else none at all.
                trial = (trial + (0.0 if best is None else best.force)) / 2
                continue
            # Of a rollout that is not the best only these two are kept, because positions are large.
            shot = result.force.astype(np.float64), result.displacement
            if last is not None:
                gain = _broyden(gain, shot, last)
            last = shot
            miss = self._target - result.displacement
            size = float(np.linalg.norm(miss))
            if size < smallest:
                useless = 0 if size < 0.9 * smallest else useless + 1
                best, smallest = result, size
            else:
                useless += 1
            if smallest <= good_enough or useless >= _MAX_USELESS:
                break
            # `rcond` leaves out directions without gain: there a wall stops all motion.
            correction = np.asarray(np.linalg.lstsq(gain, miss, rcond=0.05)[0], dtype=np.float64)
            trial = _limited(shot[0] + _limited(correction))
        if best is None:
            raise failures[-1]
        return best

    def _rollout(self, acceleration: Floats) -> ControlledTrajectory:
        # Rounded here once, so that the reported acceleration is exactly the applied one.
        applied = acceleration.astype(np.float32)
        twin = self._solver.copy()
        positions = np.empty((self._frames + 1, twin.particle_count, twin.dim), dtype=np.float32)
        positions[0] = twin.positions
        for row in positions[1:]:
            self._on_frame()
            twin.advance(1, applied)
            row[:] = twin.positions
        centroids = np.array([self._weights @ frame for frame in positions])
        return ControlledTrajectory(
            positions=positions,
            force=applied,
            mean_force=np.tile(applied.astype(np.float64), (self._frames, 1)),
            target_displacement=self._target,
            displacement=centroids[-1] - centroids[0],
            centroids=centroids,
            first_frame=self._solver.frame,
        )


def _weights(solver: Simulator) -> Floats:
    """Return the mass (N,) of each particle as a fraction of the total mass."""
    mass = solver.mass.astype(np.float64)
    return np.asarray(mass / mass.sum())


def _mean(solver: Simulator, values: npt.NDArray[np.float32]) -> Floats:
    """Return the mean (D,) over the mass of a quantity (N, D) of the particles."""
    return np.asarray(_weights(solver) @ values)


def _broyden(gain: Floats, shot: tuple[Floats, Floats], last: tuple[Floats, Floats]) -> Floats:
    """Return the gain that also explains the latest pair of (acceleration, displacement)."""
    step = shot[0] - last[0]
    surprise = shot[1] - last[1] - gain @ step
    return np.asarray(gain + np.outer(surprise, step) / max(float(step @ step), 1e-12))


def _limited(acceleration: Floats) -> Floats:
    size = float(np.linalg.norm(acceleration))
    return acceleration * min(1.0, MAX_ACCELERATION / max(size, 1e-12))

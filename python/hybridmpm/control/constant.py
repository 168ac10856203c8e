"""The paper's baseline controller: one acceleration, the same for all particles and all frames.

Written in closed form for a body that nothing holds, then corrected by shooting: the solver itself
is run on copies, because walls, obstacles and the fluid's own pressure take part in the motion.
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
"""Largest control acceleration [m/s^2], about ten times gravity: what a target asks for beyond it is
out of reach in the frames given, and would only press the fluid through its walls."""
MAX_ROLLOUTS = 5
_CLOSE_ENOUGH = 0.01
"""Shooting ends when the miss is below this share of the wanted displacement ..."""
_SMALLEST_MISS = 1e-3
"""... or below this length [m]."""
_PATIENCE = 2
"""Rollouts in a row that may bring nothing: a wall is in the way, and more force will not help."""


@dataclass(frozen=True, eq=False)
class ControlledTrajectory:
    """What a sketch makes of the state it was drawn on. N particles, D dimensions, T frames."""

    positions: npt.NDArray[np.float32]
    """(T + 1, N, D) [m]; row 0 is the state at the start."""
    force: npt.NDArray[np.float32]
    """External acceleration besides gravity [m/s^2], as `Simulator.advance` takes it over T frames: (D,)
    where it is one constant, else (T, N, D)."""
    mean_force: Floats
    """(T, D) [m/s^2]: `force` in each frame, as the mean over the mass of the particles."""
    target_displacement: Floats
    """(D,) [m]: how far the centre of mass was asked to move."""
    displacement: Floats
    """(D,) [m]: how far it does."""
    centroids: Floats
    """(T + 1, D) [m]: centre of mass after each frame."""
    first_frame: int
    """Frame number of the solver at the start."""

    @property
    def frames(self) -> int:
        """T."""
        return len(self.positions) - 1

    def force_at(self, index: int) -> npt.NDArray[np.float32]:
        """Return the force of a frame, counted from 0 at the start: (D,) or (N, D) [m/s^2].

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

    For an unhindered body a = 2 (Delta - v_0 T) / T^2 - g, with Delta the wanted displacement, v_0
    the velocity of the centre of mass and T the time. That is tried on a copy of the solver and
    corrected by the miss (Broyden's method), at most `MAX_ROLLOUTS` times; the nearest is kept. An
    acceleration beyond `MAX_ACCELERATION` is cut to it.

    Parameters
    ----------
    solver : Simulator
        Stays as it is. Of a hybrid simulator MPM follows the sketch, because of the force; a network alone
        gets the acceleration as one that it knows.
    sketch : Arrow or Ellipse
        An arrow asks for tip minus tail, an ellipse for its centre minus the present centre of
        mass. In 3D the widths give the depth; without widths the depth does not change.
    frames : int in [1, 10000]
        T / frame_dt.
    on_frame : callable, optional
        Called before each frame of each trial. What it raises ends the search, unless it is a
        SimulationError.

    Raises
    ------
    ConfigError
        `frames` is out of range, or the scene has emitters or sinks: the centre of mass then moves with the
        particles that come and go.
    SimulationError
        The solver failed under every acceleration tried; the last failure.

    References
    ----------
    The baseline of the control experiments of arXiv:2505.18926, which leave open how it is found.
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
    """Tries accelerations on copies of the solver and remembers the nearest result."""

    def __init__(
        self, solver: Simulator, target: Floats, frames: int, on_frame: Callable[[], object]
    ) -> None:
        self._solver = solver
        self._target = target
        self._frames = frames
        self._on_frame = on_frame
        self._weights = _weights(solver)

    def run(self, trial: Floats, gain: Floats) -> ControlledTrajectory:
        """Return the best trajectory; `gain` is the first guess of d displacement / d acceleration."""
        good_enough = max(_SMALLEST_MISS, _CLOSE_ENOUGH * float(np.linalg.norm(self._target)))
        best: ControlledTrajectory | None = None
        smallest, useless = np.inf, 0
        last: tuple[Floats, Floats] | None = None
        failures: list[SimulationError] = []
        for _ in range(MAX_ROLLOUTS):
            try:
                result = self._rollout(trial)
            except SimulationError as err:
                failures.append(err)
                # Halfway to what is known to work: the best so far, else no control at all.
                trial = (trial + (0.0 if best is None else best.force)) / 2
                continue
            # Only these two are kept of a rollout that is not the best: positions are large.
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
            if smallest <= good_enough or useless >= _PATIENCE:
                break
            # Directions in which a wall stops all motion have no gain: leave them alone.
            correction = np.asarray(np.linalg.lstsq(gain, miss, rcond=0.05)[0], dtype=np.float64)
            trial = _limited(shot[0] + _limited(correction))
        if best is None:
            raise failures[-1]
        return best

    def _rollout(self, acceleration: Floats) -> ControlledTrajectory:
        # Rounded once, here: what is reported is exactly what was applied.
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
    """Share of each particle in the mass (N,)."""
    mass = solver.mass.astype(np.float64)
    return np.asarray(mass / mass.sum())


def _mean(solver: Simulator, rows: npt.NDArray[np.float32]) -> Floats:
    """Mean over the mass of a quantity (N, D) of the particles."""
    return np.asarray(_weights(solver) @ rows)


def _broyden(gain: Floats, shot: tuple[Floats, Floats], last: tuple[Floats, Floats]) -> Floats:
    """Return the gain that also explains the latest pair of (acceleration, displacement)."""
    step = shot[0] - last[0]
    surprise = shot[1] - last[1] - gain @ step
    return np.asarray(gain + np.outer(surprise, step) / max(float(step @ step), 1e-12))


def _limited(acceleration: Floats) -> Floats:
    size = float(np.linalg.norm(acceleration))
    return acceleration * min(1.0, MAX_ACCELERATION / max(size, 1e-12))

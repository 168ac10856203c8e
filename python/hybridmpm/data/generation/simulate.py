"""Simulating the trajectory of a recipe and a seed."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from hybridmpm.data.generation.controlled import controlled
from hybridmpm.data.generation.solids import Solids
from hybridmpm.data.recipe import Recipe
from hybridmpm.data.trajectory import Trajectory
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Scene

_AT_ONCE = 25
"""Number of frames from one call of `stop` to the next."""
_MODES = 6
"""Number of waves of the random force."""
_LONGEST, _SHORTEST = 0.8, 0.2
"""Longest and shortest wavelength of the random force [m]."""
_SLOWEST, _FASTEST = 0.2, 2.0
"""Lowest and highest frequency of the random force [Hz]."""
_FORCE_SALT = 2**21
"""Number that the generator of the random force gets besides the seed."""


class StoppedError(Exception):
    """The caller stopped the simulation before the trajectory was done."""


def simulate(recipe: Recipe, seed: int, *, stop: Callable[[], bool] = lambda: False) -> Trajectory:
    """Simulate the scene of a seed; with `recipe.control` back to where it came from, see `controlled`.

    The trajectory has the particles of the solver first, then the rigid bodies as particles of type 0, each
    in one piece, then the obstacles as particles of type 3 (kinematic). `stop()` is called every few frames.

    Raises
    ------
    ConfigError
        The scene has emitters, sinks or moving obstacles.
    SimulationError
        The scene cannot be filled, or a frame failed.
    StoppedError
        `stop()` was true.
    """
    if recipe.control:

        def on_frame() -> None:
            if stop():
                raise StoppedError

        return controlled(recipe, seed, on_frame)
    scene = recipe.scene(seed)
    solver, solids = _solver(scene, recipe), Solids.of(scene, recipe.r_p)
    positions = np.empty((recipe.states, solver.particle_count, scene.dim), dtype=np.float32)
    force = np.zeros((recipe.states - 1, *positions.shape[1:]), dtype=np.float32) if recipe.force else None
    stirring = RandomForce(scene.dim, recipe.force, seed)
    rigid = np.empty((recipe.states, len(scene.rigid), 13))
    positions[0], rigid[0] = solver.positions, solver.rigid_numbers()
    for state in range(1, recipe.states):
        if force is not None:
            force[state - 1] = stirring.at(positions[state - 1], solver.time)
            solver.advance(1, force[state - 1])
        else:
            _advance(solver, recipe.stride, stop)
        positions[state], rigid[state] = solver.positions, solver.rigid_numbers()
        if state % _AT_ONCE == 0 and stop():
            raise StoppedError
    return solids.trajectory(solver, positions, force=force, seed=seed, rigid=rigid)


def _solver(scene: Scene, recipe: Recipe) -> MpmSolver:
    if scene.emitters or scene.sinks:
        raise ConfigError("a trajectory has the same particles throughout: remove emitters and sinks")
    return MpmSolver(scene, substeps=recipe.substeps, r_p=recipe.r_p)


def _advance(solver: MpmSolver, frames: int, stop: Callable[[], bool]) -> None:
    for done in range(0, frames, _AT_ONCE):
        if done and stop():
            raise StoppedError
        solver.advance(min(_AT_ONCE, frames - done))


class RandomForce:
    """A random acceleration that is smooth in space and time, a sum of a few travelling waves.

    Parameters
    ----------
    dim : int
        Dimension D.
    strength : float
        Root mean square of the acceleration's length over space and time [m/s^2].
    seed : int
        Seed of the waves; the same seed gives the same acceleration.
    """

    def __init__(self, dim: int, strength: float, seed: int) -> None:
        rng = np.random.default_rng([_FORCE_SALT, seed])

        def directions() -> npt.NDArray[np.float64]:
            vectors = rng.normal(size=(_MODES, dim))
            return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

        wavelength = rng.uniform(_SHORTEST, _LONGEST, size=(_MODES, 1))
        self._wave = 2 * np.pi * directions() / wavelength
        self._frequency = 2 * np.pi * rng.uniform(_SLOWEST, _FASTEST, size=_MODES)
        self._phase = rng.uniform(0, 2 * np.pi, size=_MODES)
        # The mean of a cosine's square is 1/2.
        self._push = directions() * strength * np.sqrt(2 / _MODES)

    def at(self, x: npt.NDArray[np.float32], time: float) -> npt.NDArray[np.float32]:
        """Return the accelerations (N, D) [m/s^2] at points (N, D) [m] and a time [s]."""
        waves = np.cos(x @ self._wave.T + self._frequency * time + self._phase)
        return np.asarray(waves @ self._push, dtype=np.float32)

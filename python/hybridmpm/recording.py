"""Running a solver while keeping what files and pictures are made from."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.arguments import whole
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MAX_FRAMES_AT_ONCE, MpmSolver
from hybridmpm.scene import Scene

MAX_BYTES = 4 * 2**30
"""A recording is held in memory; one larger than this is refused before it starts."""
_AT_ONCE = 25
"""Frames between two chances to report progress and to notice Ctrl-C."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """States of a simulation at F instants."""

    scene: Scene
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,)."""
    mass: npt.NDArray[np.float32]
    """(N,) [kg]."""
    frames: npt.NDArray[np.int64]
    """Frame numbers (F,), increasing."""
    positions: npt.NDArray[np.float32]
    """(F, N, D) [m]."""
    velocities: npt.NDArray[np.float32]
    """(F, N, D) [m/s]."""

    def time(self, row: int) -> float:
        """Return the simulated time of a state [s]."""
        return float(self.frames[row]) * self.scene.frame_dt


def record(
    solver: MpmSolver, frames: int, *, every: int = 1, on_progress: Callable[[int], object] | None = None
) -> Recording:
    """Advance `solver` and keep its state now, after each `every` frames, and at the end.

    Parameters
    ----------
    solver : MpmSolver
        Left at the last frame.
    frames : int in [0, 1000000]
    every : int in [1, 1000000]
        Frames between two states kept; the last step may be shorter.
    on_progress : callable, optional
        Called with the number of frames done since its last call.

    Raises
    ------
    ConfigError
        A number is out of range, or the recording would exceed `MAX_BYTES`.
    SimulationError
        A frame failed; see `MpmSolver.advance`.
    """
    frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
    every = whole("every", every, 1, MAX_FRAMES_AT_ONCE)
    stops = [*range(0, frames, every), frames]
    shape = (len(stops), solver.particle_count, solver.dim)
    needed = 2 * 4 * int(np.prod(shape, dtype=np.int64))
    if needed > MAX_BYTES:
        raise ConfigError(
            f"a recording must fit in {MAX_BYTES / 2**30:g} GiB, but {len(stops)} states of "
            f"{solver.particle_count} particles need {needed / 2**30:.1f}; raise `every` or lower `frames`"
        )
    positions, velocities = np.empty(shape, dtype=np.float32), np.empty(shape, dtype=np.float32)
    first = solver.frame
    for row, stop in enumerate(stops):
        while solver.frame < first + stop:
            step = min(first + stop - solver.frame, _AT_ONCE)
            solver.advance(step)
            if on_progress is not None:
                on_progress(step)
        positions[row], velocities[row] = solver.positions, solver.velocities
    return Recording(
        scene=solver.scene,
        types=solver.materials,
        mass=solver.mass,
        frames=first + np.array(stops, dtype=np.int64),
        positions=positions,
        velocities=velocities,
    )

"""`Recording`, the states that files and pictures are made from, and `record`, which makes one."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError, ExportError
from hybridmpm.recording.tracks import Tracks
from hybridmpm.render import View, notebook, side_by_side, view_of
from hybridmpm.scene import Scene
from hybridmpm.simulator import MAX_FRAMES_AT_ONCE, Simulator, checked_simulator

MAX_BYTES = 4 * 2**30
"""Largest size of a recording [bytes], which is kept in memory."""
_IN_A_ROW = 4
"""Largest number of states that a notebook shows side by side."""
_AT_ONCE = 25
"""Number of frames after which progress is reported and Ctrl-C is noticed."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """States of a simulation at F frames.

    N is the number of particles that were in the scene at one of these frames or more. Emitters and sinks
    change the number of particles; positions and velocities of a particle that is not in the scene are NaN.
    """

    scene: Scene
    ids: npt.NDArray[np.uint64]
    """Ids (N,) of the particles, ascending; those of `Simulator.ids`."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,)."""
    mass: npt.NDArray[np.float32]
    """Masses (N,) [kg]."""
    frames: npt.NDArray[np.int64]
    """Frame numbers (F,), increasing."""
    positions: npt.NDArray[np.float32]
    """Positions (F, N, D) [m]."""
    velocities: npt.NDArray[np.float32]
    """Velocities (F, N, D) [m/s]."""
    spacing: float | None = None
    """Distance of the particles at rest [m]; None: that of the scene."""
    rigid: npt.NDArray[np.float64] | None = None
    """Numbers (F, B, 13) of the scene's B rigid bodies; None where it has none.

    Centre of mass [m], unit quaternion of the turn with the scalar first, velocity [m/s], angular velocity
    [rad/s], each with the components in space.
    """

    def __repr__(self) -> str:
        states = f"{len(self.frames)} states from frame {self.frames[0]} to {self.frames[-1]}"
        return f"Recording({self.scene.title}, {len(self.ids)} particles, {states})"

    def _repr_html_(self) -> str:
        rows = np.unique(np.linspace(0, len(self.frames) - 1, _IN_A_ROW).round().astype(int))
        view = view_of(self.scene, self.types, notebook.WIDTH // 2, self.spacing)
        pictures = [self.picture(view, row) for row in rows.tolist()]
        return notebook.figure(side_by_side(pictures), repr(self))

    def picture(self, view: View, row: int) -> npt.NDArray[np.uint8]:
        """Draw a state by a view of the scene; see `View.draw`."""
        rigid = None if self.rigid is None else self.rigid[row]
        return view.draw(self.positions[row], self.velocities[row], self.time(row), rigid)

    def present(self, row: int) -> npt.NDArray[np.bool_]:
        """Return whether each particle (N,) is in the scene at a state."""
        return np.asarray(np.isfinite(self.positions[row, :, 0]))

    def time(self, row: int) -> float:
        """Return the simulated time of a state [s]."""
        return float(self.frames[row]) * self.scene.frame_dt


def record(
    solver: Simulator,
    frames: int,
    *,
    every: int = 1,
    on_progress: Callable[[int], object] | None = None,
    advance: Callable[[int], object] | None = None,
) -> Recording:
    """Advance a simulator and record its state now, after every `every` frames, and at the end.

    Parameters
    ----------
    solver : Simulator
        Simulator to advance; it stays at the last frame.
    frames : int in [0, 1000000]
        Number of frames to advance.
    every : int in [1, 1000000]
        Number of frames from one recorded state to the next; the last state may follow sooner.
    on_progress : callable, optional
        Called with the number of frames done since its last call.
    advance : callable, optional
        Called with the frame to advance `solver` to, in place of `solver.advance`: forces may act on the way.

    Raises
    ------
    ConfigError
        `solver` is no simulator, a number is out of range, or the recording would exceed `MAX_BYTES`. In a
        scene with emitters this is found only when the particles have come.
    SimulationError
        A frame failed; see `Simulator.advance`.
    """
    checked_simulator(solver)
    frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
    every = whole("every", every, 1, MAX_FRAMES_AT_ONCE)
    stops = [*range(0, frames, every), frames]
    check_size(len(stops), solver.particle_count, solver.dim)
    tracks = Tracks(solver, len(stops), "positions", "velocities")
    first = solver.frame
    rigid = np.empty((len(stops), len(solver.scene.rigid), 13))
    for row, stop in enumerate(stops):
        while solver.frame < first + stop:
            step = min(first + stop - solver.frame, _AT_ONCE)
            if advance is None:
                solver.advance(step)
            else:
                advance(solver.frame + step)
            if on_progress is not None:
                on_progress(step)
        tracks.take(row)
        rigid[row] = solver.rigid_numbers()
        check_size(len(stops), len(tracks.ids), solver.dim)
    return Recording(
        scene=solver.scene,
        ids=tracks.ids,
        types=tracks.types,
        mass=tracks.mass,
        frames=first + np.array(stops, dtype=np.int64),
        positions=tracks["positions"],
        velocities=tracks["velocities"],
        spacing=solver.particle_spacing,
        rigid=rigid if solver.scene.rigid else None,
    )


def checked_recording(recording: object) -> Recording:
    """Return a recording; refuse anything else, such as a simulator, by an `ExportError`."""
    if isinstance(recording, Recording):
        return recording
    kind = type(recording).__name__
    raise ExportError(
        f"recording must be a Recording, such as record(solver, 100), got an object of type {kind}"
    )


def check_size(states: int, particles: int, dim: int) -> None:
    """Refuse a recording of so many states that it would exceed `MAX_BYTES`, by a ConfigError."""
    needed = 2 * 4 * states * particles * dim
    if needed > MAX_BYTES:
        raise ConfigError(
            f"a recording must fit in {MAX_BYTES / 2**30:g} GiB, but {states} states of "
            f"{particles} particles need {needed / 2**30:.1f}; raise `every` or lower `frames`"
        )

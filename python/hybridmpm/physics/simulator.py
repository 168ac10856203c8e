"""`NeuralPhysics`: a scene that a network moves."""

import copy
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError
from hybridmpm.mpm import MpmSolver
from hybridmpm.mpm.solver import MAX_FRAMES_AT_ONCE, acceleration
from hybridmpm.physics.model import NeuralModel
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track
from hybridmpm.scene import Scene


class NeuralPhysics:
    """A learned simulator on a scene; a `Simulator`.

    The first 5 r_t frames, which the network looks back on, are MPM's. From then on the network steps r_t
    frames at once, and frames between are interpolated. N is the number of fluid particles, D the dimension;
    obstacles take part as kinematic particles that are not among them.

    Parameters
    ----------
    scene : Scene
    model : Stepper
        A `NeuralModel`, or anything that steps like one.
    threads : int in [1, 1024]
        Of the first frames; those of the network are its own.

    Raises
    ------
    ConfigError
        The scene is not of the kind that the model was trained on, or a setting is out of range.
    SceneError
        The scene cannot be filled with particles.

    Notes
    -----
    A frame that fails raises `NonFiniteError`, `DomainError` or `GraphSizeError`, or in the first frames an
    error of `MpmSolver`, and the state is the one before that frame.
    """

    def __init__(self, scene: Scene, model: Stepper, *, threads: int = 1) -> None:
        model.check(scene)
        self._model = model
        self._solver = MpmSolver(scene, r_p=model.r_p, threads=threads)
        self._frame = 0
        self._track = self._fresh_track()

    @classmethod
    def load(cls, name: str | Path, scene: Scene, *, threads: int = 1) -> Self:
        """Load a model by name or file (`NeuralModel.load`) and put it on a scene."""
        return cls(scene, NeuralModel.load(name, threads=threads), threads=threads)

    @property
    def model(self) -> Stepper:
        """What steps."""
        return self._model

    @property
    def scene(self) -> Scene:
        """The scene it was made from."""
        return self._solver.scene

    @property
    def dim(self) -> int:
        """D, 2 or 3."""
        return self.scene.dim

    @property
    def frame(self) -> int:
        """Frames done since the start."""
        return self._frame

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self._frame * self.scene.frame_dt

    @property
    def particle_count(self) -> int:
        """N."""
        return self._solver.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) of the particles: 0, 1, ..."""
        return self._solver.ids

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m]; a copy."""
        return self._track.positions.copy()

    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m/s]; a copy."""
        return self._solver.velocities if self._by_mpm else self._track.velocities

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,), read-only: 5 water, 6 sand, 7 elastic (goop)."""
        return self._solver.materials

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """(N,) [kg], read-only; in 2D of a slice one metre deep."""
        return self._solver.mass

    def advance(self, frames: int = 1, force: npt.ArrayLike | None = None) -> None:
        """Go on by whole frames.

        Parameters
        ----------
        frames : int in [0, 1000000]
        force : (N, D) or (frames, N, D), optional
            External acceleration [m/s^2] besides gravity, held over the call or given per frame. Taken as
            float32. A change within a network step takes effect at once, and the network sees it from its
            next step on.

        Raises
        ------
        NonFiniteError, DomainError, GraphSizeError, InvertedError, StepSizeError
            Naming particle and frame. The state is then the one before the failed frame.
        ConfigError
            `frames` out of range or `force` of a wrong shape; nothing has moved.
        """
        frames, force = self._arguments(frames, force)
        for k in range(frames):
            self._advance(None if force is None else force[k])

    def rollout(self, frames: int, force: npt.ArrayLike | None = None) -> npt.NDArray[np.float32]:
        """Advance, and return where the particles were on the way.

        Parameters and errors are those of `advance`.

        Returns
        -------
        float32 (frames + 1, N, D)
            Positions [m]; the first row is the state before the call.
        """
        frames, force = self._arguments(frames, force)
        path = np.empty((frames + 1, self.particle_count, self.dim), dtype=np.float32)
        path[0] = self._track.positions
        for k in range(frames):
            self._advance(None if force is None else force[k])
            path[k + 1] = self._track.positions
        return path

    def reset(self) -> None:
        """Go back to frame 0."""
        self._solver.reset()
        self._frame = 0
        self._track = self._fresh_track()

    def copy(self) -> Self:
        """Return an independent simulator in the same state; the two share the model."""
        twin = copy.copy(self)
        twin._solver, twin._track = self._solver.copy(), self._track.copy()  # noqa: SLF001 - of this class
        return twin

    @property
    def _by_mpm(self) -> bool:
        return self._frame == self._solver.frame

    def _fresh_track(self) -> Track:
        track = Track(self._model, self.scene, self.materials)
        track.observe(self._solver.positions)
        return track

    def _advance(self, force: npt.NDArray[np.float32] | None) -> None:
        if self._track.ready:
            self._track.advance(self._frame + 1, force)
        else:
            self._solver.advance(1, force)
            self._track.observe(self._solver.positions)
        self._frame += 1

    def _arguments(
        self, frames: int, force: npt.ArrayLike | None
    ) -> tuple[int, npt.NDArray[np.float32] | None]:
        frames = whole("frames", frames, 0, MAX_FRAMES_AT_ONCE)
        given = acceleration("force", force)
        if given is None:
            return frames, None
        one = (self.particle_count, self.dim)
        if given.shape not in {one, (frames, *one)}:
            raise ConfigError(f"force must have shape {one} or {(frames, *one)}, got {given.shape}")
        return frames, np.broadcast_to(given, (frames, *one))

"""`Track`: a network's history, and the frames within its steps."""

import copy
from collections import deque
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.coarse.merging import spacing_at
from hybridmpm.errors import ConfigError, SnapshotError
from hybridmpm.physics.spec import HISTORY
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track.path import StepPath
from hybridmpm.scene import Scene
from hybridmpm.scene.kinematic import kinematic_particles
from hybridmpm.scene.particle_types import KINEMATIC

_Floats = npt.NDArray[np.float32]


def warmup_frames(r_t: int) -> int:
    """Frames after frame 0 before a network that steps `r_t` frames has all the states that it needs."""
    return (HISTORY - 1) * r_t


class Track:
    """History of a network, and its step under way.

    The history is the latest six states, `r_t` frames apart. `observe` adds one computed elsewhere, `arrive`
    the end of the network's own step. Obstacles take part as kinematic particles that are not
    among the N.

    Parameters
    ----------
    stepper : Stepper
        The network.
    scene : Scene
        Scene of a kind that the network was made for; see `Stepper.check`.
    materials : (N,)
        DeepMind's types of the fluid particles.

    Raises
    ------
    ConfigError
        The network was not made for such a scene, or its r_t is out of range.
    """

    def __init__(self, stepper: Stepper, scene: Scene, materials: npt.NDArray[np.integer]) -> None:
        stepper.check(scene)
        self._stepper, self._scene = stepper, scene
        self.r_t = whole("r_t of the network", stepper.r_t, 1, 100)
        """Frames that one step spans."""
        self.step_dt = self.r_t * scene.frame_dt
        """Time that one step spans [s]."""
        self.walls = np.array([scene.walls.lower, scene.walls.upper], dtype=np.float32)
        """Lower and upper corner (2, D) [m]."""
        self._solids = kinematic_particles(scene, spacing_at(scene, stepper.r_p))
        solid_types = np.full(len(self._solids), KINEMATIC)
        self.types = np.concatenate([materials, solid_types]).astype(np.int64)
        """DeepMind's types (N + K,) of the fluid particles and of the K particles of obstacles."""
        self._fluid = len(materials)
        self.gravity = np.array(scene.gravity, dtype=np.float32)
        """Acceleration (D,) [m/s^2]."""
        self._states: deque[_Floats] = deque(maxlen=HISTORY)
        self._path: StepPath | None = None
        self._phase = 0

    @property
    def ready(self) -> bool:
        """Whether the history is complete."""
        return len(self._states) == HISTORY

    @property
    def states(self) -> Sequence[_Floats]:
        """The latest states, at most six, each (N, D) [m], oldest first; not to be written to."""
        return self._states

    @property
    def is_under_way(self) -> bool:
        """Whether a step has started and not ended."""
        return self._path is not None and self._phase < self.r_t

    @property
    def phase(self) -> int:
        """Frames of the step that are over, in [0, r_t]."""
        return self._phase

    @property
    def end(self) -> _Floats:
        """Positions (N, D) [m] that the step under way leads to."""
        return self._under_way().end

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m] at the present frame; not to be written to."""
        if self._path is None or self._phase == self.r_t:
            return self._states[-1]
        return np.clip(self._path.at(self._phase / self.r_t), *self.walls)

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s] within the latest step of the network or at its end."""
        return self._under_way().velocity(self._phase / self.r_t) / np.float32(self.step_dt)

    def observe(self, positions: _Floats) -> None:
        """Take in a state (N, D) [m] computed elsewhere, `r_t` frames after the last; ends a step under way.

        The array must not change afterwards.
        """
        self._states.append(positions)
        self._path, self._phase = None, 0

    def predict(self, force: _Floats | None = None) -> _Floats:
        """Return the network's positions of the particles one step later.

        Parameters
        ----------
        force : (D,) or (N, D), optional
            External acceleration [m/s^2] besides gravity.

        Returns
        -------
        float32 (N, D)
            Positions [m]; they may be anything, NaN among it.

        Raises
        ------
        ConfigError
            The network's answer has another shape.
        """
        if not self.ready:
            raise RuntimeError(f"the network needs {HISTORY} states, got {len(self._states)}")
        history = self.history()
        known = np.tile(self.gravity, (len(self.types), 1))
        known[: self._fluid] = self._known(force)
        after = np.asarray(self._stepper.step(history, self.types, known, self.walls), dtype=np.float32)
        if after.shape != history.shape[1:]:
            raise ConfigError(
                f"the network must answer positions of shape {history.shape[1:]}, got {after.shape}"
            )
        return after[: self._fluid]

    def history(self) -> _Floats:
        """Return the latest states with the obstacles, (6, N + K, D) [m], oldest first."""
        history = np.empty((len(self._states), len(self.types), self._scene.dim), dtype=np.float32)
        history[:, : self._fluid] = list(self._states)
        history[:, self._fluid :] = self._solids
        return history

    def begin(self, after: _Floats, force: _Floats | None = None) -> None:
        """Begin a step that leads to `after` (N, D) [m], under a force as in `predict`."""
        known = self._known(force) * np.float32(self.step_dt**2)
        self._path = StepPath.between(self._states[-2], self._states[-1], after, known)
        self._phase = 0

    def push(self, change: _Floats) -> None:
        """Change the force within the step under way, by (D,) or (N, D) [m/s^2]; see `StepPath.pushed`."""
        step = np.broadcast_to(change, (self._fluid, self._scene.dim)) * np.float32(self.step_dt**2)
        self._path = self._under_way().pushed(self._phase / self.r_t, step, *self.walls)

    def tick(self) -> None:
        """Go on by one frame of the step under way."""
        self._phase += 1

    def arrive(self) -> None:
        """Take the end of the step as the latest state; its velocities stay known."""
        self._states.append(np.clip(self._under_way().end, *self.walls))
        self._phase = self.r_t

    def drop(self) -> None:
        """Give up the step under way."""
        self._path, self._phase = None, 0

    def copy(self) -> "Track":
        """Return an independent track in the same state; the two share the network."""
        twin = copy.copy(self)
        twin._states = self._states.copy()  # noqa: SLF001 - of this very class
        return twin

    def to_dict(self) -> dict[str, Any]:
        """Return the state as plain data, for a snapshot."""
        path = self._path
        return {
            "r_t": self.r_t,
            "states": list(self._states),
            "phase": self._phase,
            "path": None if path is None else {f.name: getattr(path, f.name) for f in fields(path)},
        }

    def from_dict(self, tree: dict[str, Any]) -> "Track":
        """Return a track of the same network and scene in the state that `to_dict` described.

        Raises
        ------
        SnapshotError
            The state belongs to other particles, or to a network of another r_t.
        """
        if tree["r_t"] != self.r_t:
            raise SnapshotError(
                f"the snapshot was made with a network of r_t = {tree['r_t']}, this one has {self.r_t}"
            )
        shape = (self._fluid, self._scene.dim)
        for state in tree["states"]:
            if state.shape != shape:
                raise SnapshotError(f"the snapshot has states of shape {state.shape}, this scene {shape}")
        if not 0 <= tree["phase"] <= self.r_t:
            raise SnapshotError("the snapshot holds a step of the network that does not fit")
        twin = self.copy()
        twin._states = deque(tree["states"], maxlen=HISTORY)  # noqa: SLF001 - of this very class
        twin._path = None if tree["path"] is None else StepPath(**tree["path"])  # noqa: SLF001
        twin._phase = tree["phase"]  # noqa: SLF001
        return twin

    def _under_way(self) -> StepPath:
        if self._path is None:
            raise RuntimeError("no step of the network is under way")
        return self._path

    def _known(self, force: _Floats | None) -> _Floats:
        """Gravity and force of the fluid particles, (N, D) [m/s^2]."""
        known = np.tile(self.gravity, (self._fluid, 1))
        return known if force is None else known + force

"""Particles that a network moves: what it looks back on, and the frames within its steps."""

from collections import deque
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import DomainError, NonFiniteError
from hybridmpm.physics.spec import HISTORY
from hybridmpm.physics.stepper import Stepper
from hybridmpm.scene import Scene
from hybridmpm.scene.kinematic import kinematic_particles
from hybridmpm.scene.particle_types import KINEMATIC

_Floats = npt.NDArray[np.float32]


def warmup_frames(r_t: int) -> int:
    """Frames after frame 0 before a network that steps `r_t` frames has all the states that it needs."""
    return (HISTORY - 1) * r_t


@dataclass(frozen=True)
class StepPath:
    """Where particles go within a network step, from 0 to 1.

    A parabola whose curvature is that of the known acceleration, on each axis as far as the second difference
    of the network's own states confirms it. So free fall is exact, what rests stays, and an impact, which
    happens at some unknown instant, gives a straight line: a full parabola would throw particles back
    from the floor.
    """

    start: _Floats
    """Position at `begin` (N, D) [m]."""
    end: _Floats
    """Position at 1 (N, D) [m]."""
    bend: _Floats
    """Second derivative (N, D) [m per step^2]."""
    begin: float = 0.0

    @classmethod
    def between(cls, before: _Floats, now: _Floats, after: _Floats, known: _Floats) -> Self:
        """Join two states (N, D) [m] of a network, given the one before and the known acceleration.

        Parameters
        ----------
        before, now, after : (N, D)
            Successive states [m].
        known : (N, D)
            Acceleration [m per step^2].
        """
        found = after - 2 * now + before
        # The smaller of the two where they agree in sign, else 0.
        bend = np.clip(found, np.minimum(known, 0), np.maximum(known, 0))
        return cls(now, after, bend)

    def at(self, moment: float) -> _Floats:
        """Positions (N, D) [m] at a moment in [begin, 1]."""
        if moment >= 1.0:
            return self.end
        past, left = np.float32(moment - self.begin), np.float32(1.0 - moment)
        way = (self.end - self.start) * (past / (past + left))
        return np.asarray(self.start + way - self.bend * (past * left / 2))

    def velocity(self, moment: float) -> _Floats:
        """Velocities (N, D) [m per step] at a moment in [begin, 1]."""
        length = np.float32(1.0 - self.begin)
        off_middle = np.float32(moment - (1.0 + self.begin) / 2)
        return np.asarray((self.end - self.start) / length + self.bend * off_middle)

    def pushed(self, moment: float, change: _Floats, lower: _Floats, upper: _Floats) -> Self:
        """Go on from a moment with another known acceleration, within walls.

        Parameters
        ----------
        moment : float in [begin, 1)
        change : (N, D)
            Of the acceleration [m per step^2]. The end moves by it times what is left of the step: the
            network's own step, x + v + a, with the mean acceleration in it.
        lower, upper : (D,)
            Corners [m].
        """
        end = np.clip(self.end + change * np.float32(1.0 - moment), lower, upper)
        return replace(self, start=self.at(moment), end=end, begin=moment)


class Track:
    """Fluid particles under a network, frame by frame, with the obstacles as kinematic particles.

    Whatever computes the first frames hands each to `observe`, until the track is `ready`; from then on
    `advance` goes on by the network, and `observe` may take over again at any frame.

    Parameters
    ----------
    stepper : Stepper
        The network.
    scene : Scene
        Of a kind that the network was made for; see `Stepper.check`.
    materials : (N,)
        DeepMind's types of the fluid particles.

    Raises
    ------
    ConfigError
        The scene is none for the network.
    """

    def __init__(self, stepper: Stepper, scene: Scene, materials: npt.NDArray[np.integer]) -> None:
        stepper.check(scene)
        self._stepper, self._scene = stepper, scene
        self._solids = kinematic_particles(scene, scene.spacing * stepper.r_p ** (-1 / scene.dim))
        solid_types = np.full(len(self._solids), KINEMATIC)
        self._types = np.concatenate([materials, solid_types]).astype(np.int64)
        self._fluid = len(materials)
        self._walls = np.array([scene.walls.lower, scene.walls.upper], dtype=np.float32)
        self._gravity = np.array(scene.gravity, dtype=np.float32)
        self._states: deque[_Floats] = deque(maxlen=warmup_frames(stepper.r_t) + 1)
        self._path: StepPath | None = None
        self._phase = 0
        self._push = np.zeros((self._fluid, scene.dim), dtype=np.float32)

    @property
    def ready(self) -> bool:
        """Whether the network has all the states that it looks back on."""
        return len(self._states) == self._states.maxlen

    @property
    def positions(self) -> _Floats:
        """Of the latest frame (N, D) [m]; not to be written to."""
        return self._states[-1]

    @property
    def velocities(self) -> _Floats:
        """Of the latest frame (N, D) [m/s]; only after `advance`."""
        if self._path is None:
            raise RuntimeError("there are velocities only after a frame of the network")
        moment = self._phase / self._stepper.r_t
        return self._path.velocity(moment) / np.float32(self._step_dt)

    @property
    def _step_dt(self) -> float:
        return self._scene.frame_dt * self._stepper.r_t

    def observe(self, positions: _Floats) -> None:
        """Take in the next frame (N, D) [m], computed elsewhere; the array must not change afterwards."""
        self._states.append(positions)
        self._path = None

    def advance(self, frame: int, force: _Floats | None = None) -> None:
        """Go on by one frame.

        Parameters
        ----------
        frame : int
            The frame that this makes, for messages.
        force : (N, D), optional
            External acceleration [m/s^2] besides gravity. Where it changes within a network step, the
            rest of the step is moved by the change (`StepPath.pushed`), and the network sees the result at
            its next step.

        Raises
        ------
        NonFiniteError, DomainError
            Naming particle and frame; or what the stepper raises. The state is then the one before.
        """
        push = np.zeros_like(self._push) if force is None else force
        path, phase = self._path, self._phase
        if path is None or phase == self._stepper.r_t:
            path, phase = self._checked(self._next_path(push), frame), 0
        elif not np.array_equal(push, self._push):
            change = (push - self._push) * np.float32(self._step_dt**2)
            path = self._checked(path.pushed(phase / self._stepper.r_t, change, *self._walls), frame)
        state = path.at((phase + 1) / self._stepper.r_t)
        self._path, self._phase, self._push = path, phase + 1, push
        self._states.append(np.clip(state, *self._walls))

    def copy(self) -> "Track":
        """Return an independent track in the same state."""
        twin = object.__new__(Track)
        twin.__dict__ = {**self.__dict__, "_states": self._states.copy()}
        return twin

    def _next_path(self, push: _Floats) -> StepPath:
        if not self.ready:
            raise RuntimeError(f"the network needs {self._states.maxlen} frames, got {len(self._states)}")
        fluid = self._fluid
        history = np.empty((HISTORY, len(self._types), self._scene.dim), dtype=np.float32)
        history[:, :fluid] = list(self._states)[:: self._stepper.r_t]
        history[:, fluid:] = self._solids
        known = np.tile(self._gravity, (len(self._types), 1))
        known[:fluid] += push
        after = self._stepper.step(history, self._types, known, self._walls)[:fluid]
        in_steps = known[:fluid] * np.float32(self._step_dt**2)
        return StepPath.between(history[-2, :fluid], history[-1, :fluid], after, in_steps)

    def _checked(self, path: StepPath, frame: int) -> StepPath:
        bad = ~np.isfinite(path.end).all(axis=1)
        if bad.any():
            raise NonFiniteError(
                f"particle {int(bad.argmax())} became non-finite in frame {frame}, in a network step: the "
                "scene is beyond what the network can do, or a force without bound acts"
            )
        beyond = np.maximum(self._walls[0] - path.end, path.end - self._walls[1]).max(axis=1, initial=0.0)
        if (beyond > self._scene.dx).any():
            particle = int(beyond.argmax())
            raise DomainError(
                f"particle {particle} left the domain in frame {frame}, in a network step, at "
                f"{path.end[particle].tolist()} m; allowed is up to {self._scene.dx:.2e} m past a wall"
            )
        return path

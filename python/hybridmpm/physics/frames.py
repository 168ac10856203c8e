"""Frames of a network on a scene: MPM makes the first, then the network goes on."""

import copy
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import DomainError, NonFiniteError, SnapshotError
from hybridmpm.mpm import MpmSolver
from hybridmpm.physics.stepper import Stepper
from hybridmpm.physics.track import Track

_Floats = npt.NDArray[np.float32]


class NetworkFrames:
    """The n particles that a network moves by frames, without checks of arguments.

    Parameters
    ----------
    solver : MpmSolver
        Solver at frame 0 with the particles of the network; the frames' own from now on.
    stepper : Stepper
        The network.
    """

    affine = None
    """Nobody knows velocity gradients."""

    def __init__(self, solver: MpmSolver, stepper: Stepper) -> None:
        self.solver = solver
        self.frame = 0
        """Number of frames since the start."""
        self.track = Track(stepper, solver.scene, solver.materials)
        self.track.observe(solver.positions)
        self._force = np.zeros((solver.particle_count, solver.dim), dtype=np.float32)

    @property
    def is_by_mpm(self) -> bool:
        """Whether MPM made the present state."""
        return self.frame == self.solver.frame

    @property
    def particle_count(self) -> int:
        """Number n of particles."""
        return self.solver.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (n,) of the particles: 0, 1, ..."""
        return self.solver.ids

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (n,) into the scene's materials."""
        return self.solver.material

    @property
    def mass(self) -> _Floats:
        """Masses (n,) [kg]."""
        return self.solver.mass

    @property
    def positions(self) -> _Floats:
        """Positions (n, D) [m]; a copy."""
        return self.solver.positions if self.is_by_mpm else self.track.positions.copy()

    @property
    def velocities(self) -> _Floats:
        """Velocities (n, D) [m/s]; a copy."""
        return self.solver.velocities if self.is_by_mpm else self.track.velocities

    def advance(self, force: _Floats | None) -> None:
        """Advance by one frame under an acceleration, (D,) or (n, D) [m/s^2], or change nothing and raise."""
        if self.track.ready:
            held = np.zeros(self.solver.dim, dtype=np.float32) if force is None else force
            self._advance_by_network(np.broadcast_to(held, self._force.shape))
        else:
            self.solver.advance(1, force)
            if self.solver.frame % self.track.r_t == 0:
                self.track.observe(self.solver.positions)
        self.frame += 1

    def _advance_by_network(self, force: _Floats) -> None:
        track = self.track.copy()  # a frame that fails leaves the state before it
        if not track.is_under_way:
            after = track.answer(force)
            track.begin(after, force)
            self._check(track)
        elif not np.array_equal(force, self._force):
            track.push(force - self._force)
            self._check(track)
        track.tick()
        if track.phase == track.r_t:
            track.arrive()
        # A copy: the caller's array may hold another force at the next frame.
        self.track, self._force = track, force.copy()

    def _check(self, track: Track) -> None:
        """Refuse a step that leads nowhere that a particle may be."""
        frame, end = self.frame + 1, track.end
        bad = ~np.isfinite(end).all(axis=1)
        if bad.any():
            raise NonFiniteError(
                f"particle {int(bad.argmax())} became non-finite in frame {frame}, in a network step: the "
                "scene is beyond what the network can do, or a force without bound acts"
            )
        lower, upper = track.walls
        beyond = np.maximum(lower - end, end - upper).max(axis=1, initial=0.0)
        if (beyond > self.solver.scene.dx).any():
            particle = int(beyond.argmax())
            raise DomainError(
                f"particle {particle} left the domain in frame {frame}, in a network step, at "
                f"{end[particle].tolist()} m; allowed is up to {self.solver.scene.dx:.2e} m past a wall"
            )

    def copy(self) -> Self:
        """Return independent frames in the same state; the two share the network."""
        twin = copy.copy(self)
        twin.solver, twin.track = self.solver.copy(), self.track.copy()
        return twin

    def remember(self) -> dict[str, Any]:
        """Return the state as a tree for a snapshot."""
        return {
            "frame": self.frame,
            "force": np.ascontiguousarray(self._force),
            "solver": self.solver.snapshot(),
            "track": self.track.remember(),
        }

    def recall(self, memory: dict[str, Any]) -> None:
        """Take a state that `remember` returned, or change nothing and raise `SnapshotError`."""
        track, force, frame = self.track.copy(), memory["force"], memory["frame"]
        track.recall(memory["track"])
        if force.shape != self._force.shape or not 0 <= frame <= 2**53:
            raise SnapshotError("the snapshot holds a force or a frame that do not fit")
        self.solver.restore(memory["solver"])
        self.track, self._force, self.frame = track, force, frame

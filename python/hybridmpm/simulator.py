"""`Simulator`: what all simulators have in common, whatever moves the particles."""

from typing import Protocol, Self

import numpy as np
import numpy.typing as npt

from hybridmpm.scene import Scene


class Simulator(Protocol):
    """Particles of a scene that go on by whole frames. N is their number, D the dimension."""

    @property
    def scene(self) -> Scene:
        """The scene it was made from."""

    @property
    def dim(self) -> int:
        """D, 2 or 3."""

    @property
    def frame(self) -> int:
        """Frames done since the start."""

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""

    @property
    def particle_count(self) -> int:
        """N, at present."""

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that particles keep for good, ascending."""

    @property
    def positions(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m]."""

    @property
    def velocities(self) -> npt.NDArray[np.float32]:
        """Snapshot (N, D) [m/s]."""

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,)."""

    @property
    def mass(self) -> npt.NDArray[np.float32]:
        """(N,) [kg]; in 2D of a slice one metre deep."""

    def advance(self, frames: int = 1, force: npt.ArrayLike | None = None) -> None:
        """Go on by whole frames; force is an acceleration [m/s^2], (N, D) or (frames, N, D)."""

    def rollout(self, frames: int, force: npt.ArrayLike | None = None) -> npt.NDArray[np.float32]:
        """Advance, and return positions (frames + 1, N, D) [m]; the first are those before the call."""

    def reset(self) -> None:
        """Go back to frame 0."""

    def copy(self) -> Self:
        """Return an independent simulator in the same state."""

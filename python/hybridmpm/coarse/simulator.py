"""`CoarseSimulator`: a simulator that may carry all particles of its scene along with few."""

from abc import abstractmethod
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.upsampler import Few, Upsampler
from hybridmpm.simulator import Simulator

_Floats = npt.NDArray[np.float32]


class Simulated(Few, Protocol):
    """The n particles that somebody simulates."""

    @property
    def particle_count(self) -> int:
        """Number n of particles."""

    @property
    def material(self) -> npt.NDArray[np.uint8]:
        """Indices (n,) into the scene's materials."""


class CoarseSimulator(Simulator):
    """A simulator whose particles may carry all those of the scene along.

    N particles are shown, n are simulated, D is the dimension; without carrying both are the same.
    """

    @property
    @abstractmethod
    def _few(self) -> Simulated:
        """The particles that are simulated."""

    @property
    @abstractmethod
    def _upsampler(self) -> Upsampler | None:
        """Who carries all particles of the scene along; None where those simulated are shown."""

    @property
    def _shown(self) -> Simulated | Upsampler:
        """Who knows the particles that are shown."""
        return self._few if self._upsampler is None else self._upsampler

    @property
    def particle_spacing(self) -> float:
        """Distance of the particles of `positions` at rest [m]: above the scene's where they are merged."""
        return super().particle_spacing if self._upsampler is None else self.scene.spacing

    @property
    def particle_count(self) -> int:
        """Number N of particles at present."""
        return self._shown.particle_count

    @property
    def ids(self) -> npt.NDArray[np.uint64]:
        """Numbers (N,) that particles keep for good, ascending: 0, 1, ... as they came; read-only."""
        return self._shown.ids

    @property
    def positions(self) -> _Floats:
        """Positions (N, D) [m]; a snapshot, read-only."""
        return _read_only(self._shown.positions)

    @property
    def velocities(self) -> _Floats:
        """Velocities (N, D) [m/s]; a snapshot, read-only."""
        return _read_only(self._shown.velocities)

    @property
    def coarse_positions(self) -> _Floats:
        """Positions (n, D) [m] of those that are simulated: without `show_all` all; a snapshot, read-only."""
        return _read_only(self._few.positions)

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic (goop); a snapshot, read-only."""
        types = np.array([material.type_id for material in self.scene.materials], dtype=np.uint8)
        return _read_only(types[self._shown.material])

    @property
    def mass(self) -> _Floats:
        """Masses (N,) [kg], in 2D those of a slice one metre deep; a snapshot, read-only."""
        return _read_only(self._shown.mass)

    def _advance_frame(self, force: _Floats | None) -> None:
        if self._upsampler is not None and force is not None and force.ndim == 2:
            force = self._upsampler.gather_force(force)
        self._advance_few(force)
        # Not the one from before: a simulator may have gone back to an earlier state within the frame.
        if self._upsampler is not None:
            self._upsampler.follow()

    @abstractmethod
    def _advance_few(self, force: _Floats | None) -> None:
        """Advance the few by one frame under a checked acceleration, (D,) or (n, D) [m/s^2]."""


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array

"""`CoarseSimulator`: a simulator that shows the particles that it simulates, or all of the scene."""

from abc import abstractmethod
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.upsampler import CoarseParticles, Upsampler
from hybridmpm.simulator import Simulator

_Floats = npt.NDArray[np.float32]


class CoarseSimulator(Simulator):
    """A simulator of n particles, which shows N: all of the scene with an upsampler, else the same n."""

    @property
    @abstractmethod
    def _coarse(self) -> CoarseParticles:
        """The particles that are simulated."""

    @property
    @abstractmethod
    def _upsampler(self) -> Upsampler | None:
        """Upsampler to all particles of the scene; None where those simulated are shown."""

    @property
    def _shown(self) -> CoarseParticles | Upsampler:
        """Source of the particles that are shown."""
        self._update_shown()
        return self._coarse if self._upsampler is None else self._upsampler

    def _update_shown(self) -> None:
        """Let the particles shown follow, if an update is due: also one that a signal has ended."""
        # Read anew: a simulator may have gone back to an earlier state, with another upsampler.
        if self._upsampler is not None:
            self._upsampler.update()

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
        """Permanent ids (N,) of the particles: 0, 1, ... in order of appearance; read-only."""
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
        """Positions (n, D) [m] of the particles simulated, all without `show_all`; a snapshot, read-only."""
        return _read_only(self._coarse.positions)

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """Particle types (N,): 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid; a snapshot, read-only."""
        types = np.array([material.type_id for material in self.scene.materials], dtype=np.uint8)
        return _read_only(types[self._shown.material])

    @property
    def mass(self) -> _Floats:
        """Masses (N,) [kg], in 2D those of a slice one metre deep; a snapshot, read-only."""
        return _read_only(self._shown.mass)

    def _advance_frame(self, force: _Floats | None) -> None:
        self._update_shown()
        if self._upsampler is not None and force is not None and force.ndim == 2:
            force = self._upsampler.gather_force(force)
        self._advance_coarse(force)
        self._update_shown()

    @abstractmethod
    def _advance_coarse(self, force: _Floats | None) -> None:
        """Advance the coarse particles by a frame under a checked acceleration, (D,) or (n, D) [m/s^2]."""


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array

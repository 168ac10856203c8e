"""Fields of a simulation, coarse enough to be drawn: means over the cells of a grid."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from hybridmpm.probes.probe import PressureSamples

_Floats = npt.NDArray[np.float64]

CELLS_PER_METRE = 20
"""Cells of a grid of forces."""
_PRESSURE_SPACINGS = 2.0
"""Side of a cell of pressures, in spacings of the particles that have them."""


@dataclass(frozen=True, eq=False)
class CellMeans:
    """Means over the particles of each cell of a grid where there is any.

    C is the number of these cells, D the dimension.
    """

    frame: int
    """Number of frames since the start."""
    cell: float
    """Side of a cell [m]."""
    points: _Floats
    """Mean position (C, D) of the cell's particles [m]."""
    values: _Floats
    """Mean value (C, K) of the cell's particles."""

    @classmethod
    def of(
        cls, frame: int, cell: float, positions: npt.NDArray[np.float32], values: npt.NDArray[np.float32]
    ) -> Self:
        """Average the values (N, K) of particles at positions (N, D) [m] over cells of a side [m]."""
        cells = np.floor(positions / np.float32(cell)).astype(np.int64)
        _, member = np.unique(cells, axis=0, return_inverse=True)
        member = member.ravel()
        count = np.bincount(member)

        def mean(columns: npt.NDArray[np.float32]) -> _Floats:
            sums = [np.bincount(member, column, len(count)) for column in columns.T]
            return np.stack(sums, axis=1) / count[:, None]

        return cls(frame, cell, mean(positions), mean(values))

    @classmethod
    def of_force(cls, frame: int, positions: npt.NDArray[np.float32], force: npt.NDArray[np.float32]) -> Self:
        """Average accelerations (N, D) [m/s^2]; cells where nothing acts are left out."""
        means = cls.of(frame, 1 / CELLS_PER_METRE, positions, force)
        acting = (means.values != 0).any(axis=1)
        return cls(frame, means.cell, means.points[acting], means.values[acting])

    @classmethod
    def of_pressure(cls, frame: int, samples: PressureSamples) -> Self:
        """Average the pressures [Pa] of the particles that are simulated."""
        cell = _PRESSURE_SPACINGS * samples.spacing
        return cls.of(frame, cell, samples.x, samples.pressure[:, None])

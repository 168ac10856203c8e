"""The force that acts on a simulation, coarse enough to be drawn: its mean over cells."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

CELLS_PER_METRE = 20


@dataclass(frozen=True)
class ForceField:
    """What acts in the next frame besides gravity, in each cell of a grid where anything does.

    C is the number of these cells, D the dimension.
    """

    frame: int
    """Number of frames before that frame."""
    cell: float
    """Side of a cell [m]."""
    points: npt.NDArray[np.float64]
    """Mean position (C, D) of the cell's particles [m]."""
    force: npt.NDArray[np.float64]
    """Mean acceleration (C, D) of the cell's particles [m/s^2]."""

    @classmethod
    def of(
        cls, frame: int, positions: npt.NDArray[np.float32], force: npt.NDArray[np.float32]
    ) -> "ForceField":
        """Average the accelerations (N, D) [m/s^2] of particles at positions (N, D) [m] over cells."""
        cells = np.floor(CELLS_PER_METRE * positions).astype(np.int64)
        _, member = np.unique(cells, axis=0, return_inverse=True)
        member = member.ravel()
        count = np.bincount(member)

        def mean(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
            sums = [np.bincount(member, column, len(count)) for column in values.T]
            return np.stack(sums, axis=1) / count[:, None]

        points, accelerations = mean(positions), mean(force)
        acting = (accelerations != 0).any(axis=1)
        return cls(frame, 1 / CELLS_PER_METRE, points[acting], accelerations[acting])

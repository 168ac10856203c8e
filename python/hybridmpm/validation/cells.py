"""Where material ends, told by how many particles the grid's cells hold."""

import numpy as np
import numpy.typing as npt

from hybridmpm.scene import Scene
from hybridmpm.validation.case import Floats


def counts(x: npt.NDArray[np.float32], corner: tuple[float, float], scene: Scene) -> Floats:
    """Particles at `x` (N, 2) in each cell right of and above `corner`, by column and row."""
    cells = np.arange(scene.resolution + 1) * scene.dx
    return np.asarray(np.histogram2d(x[:, 0], x[:, 1], bins=(corner[0] + cells, corner[1] + cells))[0])


def extent(filled: npt.NDArray[np.bool_]) -> int:
    """Cells up to and with the last one that is filled; 0 without any."""
    return int(np.flatnonzero(filled)[-1]) + 1 if filled.any() else 0

"""Where material ends, found by the number of particles in the cells of a grid."""

import numpy as np
import numpy.typing as npt

from hybridmpm.scene import Scene
from hybridmpm_lab.validation.case import Floats


def counts(x: npt.NDArray[np.float32], corner: tuple[float, float], scene: Scene) -> Floats:
    """Return the number of particles at `x` (N, 2) in each cell (columns, rows), with `corner` lower left."""
    cells = np.arange(scene.resolution + 1) * scene.dx
    return np.asarray(np.histogram2d(x[:, 0], x[:, 1], bins=(corner[0] + cells, corner[1] + cells))[0])


def extent(filled: npt.NDArray[np.bool_]) -> int:
    """Return the number of cells up to the last filled one, that one included; 0 where none is filled."""
    return int(np.flatnonzero(filled)[-1]) + 1 if filled.any() else 0

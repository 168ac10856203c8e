"""The grid mass of a simulator's present state, from which grid errors are taken."""

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics
from hybridmpm.simulator import Simulator


def present_grid_mass(simulator: Simulator) -> npt.NDArray[np.float32]:
    """Return the normalised mass on the nodes of the scene's grid [-].

    Particles outside of the world box are counted on its boundary, so that a network that loses some still
    has an error.
    """
    return metrics.grid_mass(np.clip(simulator.positions, 0, 1), simulator.mass, simulator.scene.resolution)

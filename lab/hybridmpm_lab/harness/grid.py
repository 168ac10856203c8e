"""Grid masses of true states, from which grid errors are taken."""

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics


class TrueGrids:
    """Grids of the states of a truth, for comparing many simulations with it by `metrics.grid_rmse`.

    Parameters
    ----------
    x : (F, N, D)
        Positions [m] of F states.
    mass : (N,)
        Masses [kg].
    resolution : int
        Cells per metre of the scene's grid.
    """

    def __init__(self, x: npt.NDArray[np.float32], mass: npt.NDArray[np.float32], resolution: int) -> None:
        self._resolution = resolution
        self._masses = np.stack([self._normalised(one, mass) for one in x])
        self._norms = np.linalg.norm(self._masses, axis=1)

    def rmse(self, row: int, x: npt.NDArray[np.float32], mass: npt.NDArray[np.float32]) -> float:
        """Return the `grid_rmse` of particles (n, D), (n,) against the state `row`, in single precision."""
        apart = self._normalised(x, mass) - self._masses[row]
        return float(np.sqrt(np.dot(apart, apart)) / self._norms[row])

    def nrmse_over_rmse(self, row: int) -> float:
        """Return by what a `grid_rmse` against the state `row` has to be multiplied for the `grid_nrmse`."""
        true = self._masses[row]
        return float(self._norms[row] / (np.sqrt(true.size) * true.max()))

    def _normalised(
        self, x: npt.NDArray[np.float32], mass: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.float32]:
        nodes = metrics.grid_mass(x, mass, self._resolution).ravel()
        share: npt.NDArray[np.float32] = nodes / np.float32(nodes.sum(dtype=np.float64))
        return share

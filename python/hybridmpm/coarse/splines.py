"""Quadratic B-splines on the nodes of a grid over a world, for computations outside the compiled core."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Stencils:
    """The 3^D nodes around each of N points, with their weights (Jiang et al. 2016, Eq. 123).

    As in the core's `grid_mass`, a node outside the box is replaced by the nearest node inside.
    """

    nodes: npt.NDArray[np.int64]
    """Indices (N, 3^D) of the nodes in a raveled grid."""
    weights: _Floats
    """Weights (N, 3^D) of the nodes [-]; the weights of a point sum to 1."""
    shape: tuple[int, ...]
    """Shape of the grid: one node more than it has cells, along each axis."""

    @classmethod
    def at(
        cls, x: npt.NDArray[np.floating], resolution: int, counts: tuple[int, ...] | None = None
    ) -> "Stencils":
        """Find the nodes and weights of points (N, D) [m] on a grid of so many cells per metre.

        It has `counts` (D,) cells along each axis, those of one metre if absent.
        """
        cells = np.asarray(x, dtype=np.float64) * resolution
        count, dim = cells.shape
        counts = counts or (resolution,) * dim
        base = np.floor(cells - 0.5).astype(np.int64)
        offset = cells - base
        along = np.stack(
            [0.5 * (1.5 - offset) ** 2, 0.75 - (offset - 1) ** 2, 0.5 * (offset - 0.5) ** 2], axis=-1
        )
        nodes, weights = np.zeros((count, 1), dtype=np.int64), np.ones((count, 1))
        for axis in range(dim):
            line = np.clip(base[:, axis, None] + np.arange(3), 0, counts[axis])
            nodes = (nodes[:, :, None] * (counts[axis] + 1) + line[:, None]).reshape(count, -1)
            weights = (weights[:, :, None] * along[:, axis][:, None]).reshape(count, -1)
        return cls(nodes, weights, tuple(cells + 1 for cells in counts))

    def scatter(self, values: _Floats) -> _Floats:
        """Return a grid with the values (N,) of the points, each distributed to its nodes by weight."""
        size = int(np.prod(self.shape))
        sums = np.bincount(self.nodes.ravel(), (self.weights * values[:, None]).ravel(), size)
        return sums.astype(np.float64).reshape(self.shape)

    def gather(self, grid: _Floats) -> _Floats:
        """Return the values (N,) of a grid, interpolated to the points."""
        return np.asarray((self.weights * grid.ravel()[self.nodes]).sum(axis=1))

"""Control nodes: groups of particles for each of which one force is generated."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.merging import balanced_clusters

COUNT = 128
"""Number of control nodes."""
_NEIGHBORS = 4
"""Number of nodes whose forces a particle feels."""
_BLOCK = 1024
"""Number of particles whose distances to all nodes are held at a time."""

Floats = npt.NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class Nodes:
    """K groups of N particles that were near to each other when control began."""

    group: npt.NDArray[np.int64]
    """Node of each particle (N,)."""
    share: npt.NDArray[np.float64]
    """Mass of each particle over that of its node (N,) [-]."""
    near: npt.NDArray[np.int64]
    """Nodes that each particle feels (N, 4)."""
    weight: npt.NDArray[np.float32]
    """Weights of these (N, 4) [-]; they add up to 1."""
    types: npt.NDArray[np.int64]
    """DeepMind's particle type of the first particle of each node (K,)."""

    @classmethod
    def of(
        cls, x: npt.NDArray[np.float64], mass: npt.NDArray[np.floating], types: npt.NDArray[np.uint8]
    ) -> Self:
        """Return the nodes of particles at x (N, D) [m] with `mass` (N,) and `types` (N,)."""
        count = min(COUNT, len(x))
        group = balanced_clusters(x, count, seed=0).astype(np.int64)
        of_group = np.bincount(group, mass, minlength=count)
        share = mass / of_group[group]
        centers = _sums(group, share, x, count)
        near = np.empty((len(x), min(_NEIGHBORS, count)), dtype=np.int64)
        weight = np.empty(near.shape, dtype=np.float32)
        # About half the distance of neighbouring nodes, below which weights no longer grow.
        softening = 0.5 * float(np.sqrt(((x - centers[group]) ** 2).sum(axis=1).mean())) + 1e-9
        for first in range(0, len(x), _BLOCK):
            rows = slice(first, first + _BLOCK)
            square = ((x[rows, None] - centers) ** 2).sum(axis=2)
            near[rows] = np.argsort(square, axis=1, kind="stable")[:, : near.shape[1]]
            found = 1.0 / (np.take_along_axis(square, near[rows], axis=1) + softening**2)
            weight[rows] = found / found.sum(axis=1, keepdims=True)
        firsts = np.unique(group, return_index=True)[1]
        return cls(group, share, near, weight, types[firsts].astype(np.int64))

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """Return nodes from their fields, `vars(nodes)`."""
        return cls(**fields)

    def gathered(self, values: Floats) -> npt.NDArray[np.float64]:
        """Return means (K, D) over the particles of each node of values (N, D), weighted by mass."""
        return _sums(self.group, self.share, values, len(self.types))

    def spread(self, field: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return what each particle feels (N, D) of a field of the nodes (K, D)."""
        return np.asarray(np.einsum("nk,nkd->nd", self.weight, field[self.near]), dtype=np.float32)


def _sums(
    group: npt.NDArray[np.int64], share: npt.NDArray[np.floating], values: Floats, count: int
) -> npt.NDArray[np.float64]:
    columns = [np.bincount(group, share * column, minlength=count) for column in values.T]
    return np.stack(columns, axis=1)

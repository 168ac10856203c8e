"""Elastic bodies that have come apart."""

import numpy as np
import numpy.typing as npt

from hybridmpm import _core

WHOLE = 0.99
"""Smallest share of a body [-] that the largest piece of a whole one has: single particles may be lost."""
_REACH = 1.5
"""Side of the cubes that join particles [grid cells].

Particles of neighbouring cubes belong together. So a gap of 1.5 cells always joins, and one of 3 cells,
across which particles share no grid nodes, never does.
"""


def torn_bodies(x: npt.NDArray[np.float32], body: npt.NDArray[np.integer], dx: float) -> dict[int, float]:
    """Return the bodies that have come apart, each with its largest piece's share of the particles [-].

    Parameters
    ----------
    x : (n, D)
        Positions of the particles of elastic bodies [m].
    body : (n,)
        The body of each.
    dx : float
        Size of a grid cell [m].
    """
    shares = {int(number): largest_piece(x[body == number], dx) for number in np.unique(body)}
    return {number: share for number, share in shares.items() if share < WHOLE}


def largest_piece(x: npt.NDArray[np.float32], dx: float) -> float:
    """Return the share of points (n, D) in the largest piece on a grid of cells of side `dx` [m]."""
    cubes, cube, counts = np.unique(
        np.floor(x / (_REACH * dx)).astype(np.int32), axis=0, return_inverse=True, return_counts=True
    )
    graph = _core.radius_graph(cubes.astype(np.float32), 1.01 * x.shape[1] ** 0.5)
    one, two = graph.senders, graph.receivers
    label = np.arange(len(cubes))
    while True:
        lower = label.copy()
        np.minimum.at(lower, two, label[one])
        lower = lower[lower]
        if (lower == label).all():
            return float(np.bincount(label, counts).max() / len(cube))
        label = lower

"""Clusters of nearby points whose sizes differ by at most one: k-means with fixed sizes."""

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import whole

_ROUNDS = 24
"""Rounds of exchanges between neighbours; twice as many shrink the clusters' radii by less than 1 % more."""
_REACH = 3.5
"""Largest distance of neighbouring centres, in root mean square radii of a cluster."""

_Points = npt.NDArray[np.float64]
_Labels = npt.NDArray[np.int64]


def balanced_clusters(x: npt.NDArray[np.floating], count: int, *, seed: int = 0) -> _Labels:
    """Group points into clusters of floor(N / count) points or one more.

    First the points are divided along the longest side of their box, in proportion to the clusters to be made
    on either side, and so on until each part is one cluster. Then pairs of neighbouring clusters exchange
    points: all points of a pair are ordered along the line between the two centres and divided again, each
    cluster keeping its size. No exchange raises the sum of squared distances to the centres, which k-means
    lowers, too, but with free sizes.

    Parameters
    ----------
    x : (N, D)
        Points, D = 2 or 3.
    count : int in [1, N]
        Number of clusters.
    seed : int >= 0
        Seed of the order in which neighbours exchange; the same seed gives the same clusters.

    Returns
    -------
    int64 (N,)
        Cluster of each point, in [0, count).

    Raises
    ------
    ConfigError
        `count` is out of range.
    """
    points = np.asarray(x, dtype=np.float64)
    count = whole("count", count, 1, len(points))
    labels = _bisected(points, count)
    if 1 < count < len(points):
        rng = np.random.default_rng(seed)
        for _ in range(_ROUNDS):
            labels = _exchanged(points, labels, count, rng)
    return labels


def _bisected(x: _Points, count: int) -> _Labels:
    """Return clusters (N,) from dividing all parts at once, until each part is one cluster."""
    order = np.arange(len(x))
    sizes, clusters = np.array([len(x)]), np.array([count])
    while (clusters > 1).any():
        segment = np.repeat(np.arange(len(sizes)), sizes)
        starts = np.cumsum(sizes) - sizes
        sides = np.maximum.reduceat(x[order], starts) - np.minimum.reduceat(x[order], starts)
        along = x[order, sides.argmax(axis=1)[segment]]
        order = order[np.lexsort((along, segment))]
        halves = np.stack([clusters // 2, clusters - clusters // 2], axis=1)
        # Rounding keeps the number of points in a cluster at the floor or the ceiling of their mean number.
        first = np.rint(sizes * (halves[:, 0] / clusters)).astype(np.int64)
        sizes, clusters = np.stack([first, sizes - first], axis=1).ravel(), halves.ravel()
        sizes, clusters = sizes[clusters > 0], clusters[clusters > 0]
    labels = np.empty(len(x), dtype=np.int64)
    labels[order] = np.repeat(np.arange(count), sizes)
    return labels


def _exchanged(x: _Points, labels: _Labels, count: int, rng: np.random.Generator) -> _Labels:
    """Return clusters (N,) after an exchange in disjoint pairs of neighbours, which are drawn at random."""
    sizes = np.bincount(labels, minlength=count)
    centers = np.stack([np.bincount(labels, axis, count) for axis in x.T], axis=1) / sizes[:, None]
    partner = _partners(centers, _reach(x - centers[labels]), rng)
    if partner is None:
        return labels
    first = np.minimum(np.arange(count), partner)
    moving = np.flatnonzero((partner != np.arange(count))[labels])
    pair = first[labels[moving]]
    other = partner[pair]
    along = ((centers[other] - centers[pair]) * x[moving]).sum(axis=1)
    order = np.lexsort((along, pair))
    moving, pair, other = moving[order], pair[order], other[order]
    rank = np.arange(len(pair)) - np.searchsorted(pair, pair)
    exchanged = labels.copy()
    exchanged[moving] = np.where(rank < sizes[pair], pair, other)
    return exchanged


def _reach(offsets: _Points) -> float:
    squared = (offsets**2).sum(axis=1)
    return _REACH * float(np.sqrt(squared[squared > 0].mean())) if squared.any() else 0.0


def _partners(centers: _Points, reach: float, rng: np.random.Generator) -> _Labels | None:
    """Return a random partner (count,) of each cluster among its neighbours; None without neighbours.

    A cluster that is left over is its own partner.
    """
    if reach == 0.0:
        return None
    graph = _core.radius_graph(centers.astype(np.float32), reach)
    one, two = graph.senders.astype(np.int64), graph.receivers.astype(np.int64)
    one, two = one[one < two], two[one < two]
    if len(one) == 0:
        return None
    draw = rng.permutation(len(one))
    best = np.full(len(centers), len(one))
    np.minimum.at(best, one, draw)
    np.minimum.at(best, two, draw)
    # Edges that are the best of both their ends have no end in common.
    chosen = (best[one] == draw) & (best[two] == draw)
    partner = np.arange(len(centers))
    partner[one[chosen]], partner[two[chosen]] = two[chosen], one[chosen]
    return partner

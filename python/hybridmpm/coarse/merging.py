"""Merging of particles at a ratio r_p by balanced clusters, and the grid that fits the merged particles."""

import math

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import float64, whole
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Particles, Scene
from hybridmpm.scene.scene import MIN_CELLS_BETWEEN_WALLS
from hybridmpm.scene.world import coarsest_grid

FEWEST_PER_CELL = 2
"""Smallest number of particles per cell of a coarse grid; with fewer, bodies come apart."""

_ROUNDS = 24
"""Rounds of exchanges between neighbours; twice as many shrink the clusters' radii by less than 1 % more."""
_REACH = 3.5
"""Largest distance of neighbouring centres, in root mean square radii of a cluster."""

_Floats = npt.NDArray[np.float64]
_Labels = npt.NDArray[np.int64]


def merge(particles: Particles, r_p: float, *, seed: int = 0) -> Particles:
    """Replace particles by fewer and larger ones, one for each of the balanced clusters within a body.

    A merged particle has the mass, rest volume, momentum and centre of mass of its cluster; the sums are
    formed in float64. Cluster sizes within a body differ by at most one. A body has one material, so no
    cluster mixes materials.

    Parameters
    ----------
    particles : Particles
        N_h particles, as from `Scene.sample`.
    r_p : float in (0, 1]
        Number of particles after merging over the number before.
    seed : int >= 0
        Seed of the clusters; the same seed gives the same particles.

    Returns
    -------
    Particles
        N_l = round(r_p N_h) particles, body by body; every body has at least one, so there may be more. For
        r_p = 1, and without particles, this is the object `particles` itself.

    Raises
    ------
    ConfigError
        `r_p` is out of range.
    """
    if checked_ratio(r_p) == 1 or len(particles.x) == 0:
        return particles
    bodies, sizes = np.unique(particles.body, return_counts=True)
    labels = np.empty(len(particles.x), dtype=np.int64)
    made = 0
    for body, count in zip(bodies, _apportioned(sizes, round(r_p * len(particles.x))), strict=True):
        members = np.flatnonzero(particles.body == body)
        labels[members] = made + balanced_clusters(particles.x[members], count, seed=seed)
        made += count
    return _combined(particles, labels)


def checked_ratio(r_p: float) -> float:
    """Return `r_p`, or raise `ConfigError` unless it is in (0, 1]."""
    if not (isinstance(r_p, int | float | np.floating) and 0 < r_p <= 1):
        raise ConfigError(f"r_p must be in (0, 1], got {r_p!r}")
    return float(r_p)


def spacing_at(scene: Scene, r_p: float) -> float:
    """Return the mean distance [m] of a scene's particles merged at a ratio `r_p` in (0, 1].

    Raises
    ------
    ConfigError
        `r_p` is out of range.
    """
    return float(scene.spacing * checked_ratio(r_p) ** (-1 / scene.dim))


def _apportioned(sizes: npt.NDArray[np.int64], total: int) -> list[int]:
    """Divide `total` among groups in proportion to their sizes, at least one each, by largest remainder."""
    exact = sizes * (total / sizes.sum())
    counts = np.maximum(np.floor(exact), 1)
    missing = max(0, total - int(counts.sum()))
    counts[np.argsort(counts - exact, kind="stable")[:missing]] += 1
    return [int(count) for count in counts]


def _combined(particles: Particles, labels: npt.NDArray[np.int64]) -> Particles:
    def total(values: npt.NDArray[np.float64]) -> _Floats:
        return np.stack([np.bincount(labels, column) for column in values.reshape(len(labels), -1).T], axis=1)

    mass = particles.mass.astype(np.float64)[:, None]
    merged = total(mass)
    member = np.unique(labels, return_index=True)[1]
    return Particles(
        x=(total(mass * particles.x) / merged).astype(np.float32),
        v=(total(mass * particles.v) / merged).astype(np.float32),
        material=particles.material[member],
        types=particles.types[member],
        body=particles.body[member],
        mass=merged[:, 0].astype(np.float32),
        volume=total(particles.volume.astype(np.float64))[:, 0].astype(np.float32),
    )


def coarse_resolution(scene: Scene, r_p: float, particles_per_cell: float = FEWEST_PER_CELL) -> int:
    """Return the cells per metre of the finest grid that fits particles merged at a ratio `r_p`.

    The grid has at least `particles_per_cell` particles per cell, or as many as the scene has if these are
    fewer. It is no finer than the scene's own grid.

    Raises
    ------
    ConfigError
        `r_p` is out of range, or so small that the grid would have less than 8 cells along an axis or less
        than 4 between walls.
    """
    sparse = particles_per_cell / scene.particles_per_cell
    finest: int = math.floor(scene.resolution * (checked_ratio(r_p) / sparse) ** (1 / scene.dim) + 1e-9)
    if finest >= scene.resolution or r_p == 1:
        return scene.resolution
    narrowest = min(b - a for a, b in zip(scene.walls.lower, scene.walls.upper, strict=True))
    coarsest = max(coarsest_grid(scene.size), math.ceil(MIN_CELLS_BETWEEN_WALLS / narrowest))
    if finest < coarsest:
        raise ConfigError(
            f"r_p must be at least {sparse * (coarsest / scene.resolution) ** scene.dim:.2g} in this scene, "
            f"whose grid needs {coarsest} cells per metre at {particles_per_cell:g} particles each, got "
            f"{r_p:g}"
        )
    return finest


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
    points = float64("x", x)
    count = whole("count", count, 1, len(points))
    labels = _bisected(points, count)
    if 1 < count < len(points):
        rng = np.random.default_rng(seed)
        for _ in range(_ROUNDS):
            _core.raise_if_cancelled()
            labels = _exchanged(points, labels, count, rng)
    return labels


def _bisected(x: _Floats, count: int) -> _Labels:
    """Return clusters (N,) from dividing all parts at once, until each part is one cluster."""
    order = np.arange(len(x))
    sizes, clusters = np.array([len(x)]), np.array([count])
    while (clusters > 1).any():
        _core.raise_if_cancelled()
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


def _exchanged(x: _Floats, labels: _Labels, count: int, rng: np.random.Generator) -> _Labels:
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


def _reach(offsets: _Floats) -> float:
    squared = (offsets**2).sum(axis=1)
    return _REACH * float(np.sqrt(squared[squared > 0].mean())) if squared.any() else 0.0


def _partners(centers: _Floats, reach: float, rng: np.random.Generator) -> _Labels | None:
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

"""Merging particles at a ratio r_p, and the grid that fits the merged particles."""

import math

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse.clustering import balanced_clusters
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Particles, Scene
from hybridmpm.scene.scene import MIN_CELLS_BETWEEN_WALLS

FEWEST_PER_CELL = 2
"""Smallest number of particles per cell of a coarse grid; with fewer, bodies come apart."""

MIN_RESOLUTION = 8
"""Resolution of the coarsest grid [cells/m]."""

_Floats = npt.NDArray[np.float64]


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
        `r_p` is out of range, or so small that the grid would have less than 8 cells per metre or less than 4
        between walls.
    """
    sparse = particles_per_cell / scene.particles_per_cell
    finest: int = math.floor(scene.resolution * (checked_ratio(r_p) / sparse) ** (1 / scene.dim) + 1e-9)
    if finest >= scene.resolution or r_p == 1:
        return scene.resolution
    narrowest = min(b - a for a, b in zip(scene.walls.lower, scene.walls.upper, strict=True))
    coarsest = max(MIN_RESOLUTION, math.ceil(MIN_CELLS_BETWEEN_WALLS / narrowest))
    if finest < coarsest:
        raise ConfigError(
            f"r_p must be at least {sparse * (coarsest / scene.resolution) ** scene.dim:.2g} in this scene, "
            f"whose grid needs {coarsest} cells per metre at {particles_per_cell:g} particles each, got "
            f"{r_p:g}"
        )
    return finest

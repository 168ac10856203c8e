"""Fewer particles and fewer frames: merging at a ratio r_p, striding at r_t, and the way back.

r_p is the number of particles kept over those there were, r_t the number of frames that one step spans.
"""

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.downsampling.clustering import balanced_clusters
from hybridmpm.downsampling.splines import Stencils
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Particles, Scene
from hybridmpm.scene.scene import WALLS_APART

if TYPE_CHECKING:
    from hybridmpm.recording import Recording

__all__ = ["FEWEST_PER_CELL", "coarse_resolution", "merge", "strided", "upsample"]

FEWEST_PER_CELL = 2
"""Particles per cell that a coarse grid keeps: with fewer, bodies come apart between their particles."""

_MIN_RESOLUTION = 8
_SUPPORT = 1e-3
"""Share of a point's weights that must lie on nodes with mass for the grid to carry it."""

_Floats = npt.NDArray[np.float64]


def merge(particles: Particles, r_p: float, *, seed: int = 0) -> Particles:
    """Replace particles by fewer and larger ones, in balanced clusters within each body.

    Bodies are of one material, so no cluster mixes two. Each cluster becomes one particle with its mass, rest
    volume, momentum and centre of mass; the sums are formed in float64. Cluster sizes within a body differ by
    at most one.

    Parameters
    ----------
    particles : Particles
        N_h particles, as from `Scene.sample`.
    r_p : float in (0, 1]
    seed : int >= 0
        Of the clusters; the same seed gives the same particles.

    Returns
    -------
    Particles
        N_l = round(r_p N_h) of them, or one a body where that is more; body by body. The very argument for
        r_p = 1.

    Raises
    ------
    ConfigError
        `r_p` is out of range.
    """
    if checked_ratio(r_p) == 1:
        return particles
    bodies, sizes = np.unique(particles.body, return_counts=True)
    labels = np.empty(len(particles.x), dtype=np.int64)
    made = 0
    for body, count in zip(bodies, _shares(sizes, round(r_p * len(particles.x))), strict=True):
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
    """Return the mean distance [m] of a scene's particles once they are merged at a ratio `r_p` in (0, 1]."""
    return float(scene.spacing * checked_ratio(r_p) ** (-1 / scene.dim))


def _shares(sizes: npt.NDArray[np.int64], total: int) -> list[int]:
    """Divide `total` among groups in proportion to their sizes, at least one each, by largest remainder."""
    exact = sizes * (total / sizes.sum())
    shares = np.maximum(np.floor(exact), 1)
    missing = max(0, total - int(shares.sum()))
    shares[np.argsort(shares - exact, kind="stable")[:missing]] += 1
    return [int(share) for share in shares]


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


def coarse_resolution(scene: Scene, r_p: float) -> int:
    """Cells per metre of the finest grid for particles merged at `r_p`, no finer than the scene's own.

    It keeps `FEWEST_PER_CELL` particles per cell, or as many as the scene has where those are fewer.

    Raises
    ------
    ConfigError
        `r_p` is out of range, or so small that the grid would be coarser than 8 cells per metre, or than 4
        between walls.
    """
    sparse = FEWEST_PER_CELL / scene.particles_per_cell
    finest: int = math.floor(scene.resolution * (checked_ratio(r_p) / sparse) ** (1 / scene.dim) + 1e-9)
    if finest >= scene.resolution or r_p == 1:
        return scene.resolution
    narrowest = min(b - a for a, b in zip(scene.walls.lower, scene.walls.upper, strict=True))
    coarsest = max(_MIN_RESOLUTION, math.ceil(WALLS_APART / narrowest))
    if finest < coarsest:
        raise ConfigError(
            f"r_p must be at least {sparse * (coarsest / scene.resolution) ** scene.dim:.2g} in this scene, "
            f"whose grid needs {coarsest} cells per metre at {FEWEST_PER_CELL} particles each, got {r_p:g}"
        )
    return finest


def strided(recording: "Recording", r_t: int) -> "Recording":
    """Keep each `r_t`-th state of a recording, the first included.

    Parameters
    ----------
    recording : Recording
        F states.
    r_t : int in [1, F]

    Raises
    ------
    ConfigError
        `r_t` is out of range.
    """
    step = whole("r_t", r_t, 1, len(recording.frames))
    return dataclasses.replace(
        recording,
        frames=recording.frames[::step],
        positions=recording.positions[::step],
        velocities=recording.velocities[::step],
    )


def upsample(coarse: "Recording", x: npt.ArrayLike, *, resolution: int) -> npt.NDArray[np.float32]:
    """Carry fine particles with the motion of a coarse recording.

    Between two states the displacements of the coarse particles go to the nodes of a grid as momentum does in
    P2G, and from there to the fine particles as velocity does in G2P. Particles that no massive node is near
    fly on under gravity. Walls hold all of them; obstacles do not.

    Parameters
    ----------
    coarse : Recording
        F states of few particles; best of each frame, since a particle should move less than a few cells
        between two of them.
    x : (N, D)
        Positions of the fine particles at the first state [m].
    resolution : int in [8, 1024]
        Cells per metre of the grid, best those of the coarse run.

    Returns
    -------
    float32 (F, N, D)
        Positions of the fine particles at the states [m]; the first are `x`.

    Raises
    ------
    ConfigError
        `x` has another dimension than the recording, or `resolution` is out of range.

    References
    ----------
    Jiang et al. 2016, "The material point method for simulating continuum materials": the PIC transfers, with
    displacements for velocities.
    """
    scene = coarse.scene
    start = np.asarray(x, dtype=np.float32)
    if start.ndim != 2 or start.shape[1] != scene.dim:
        raise ConfigError(f"x must have shape (N, {scene.dim}), got {start.shape}")
    whole("resolution", resolution, _MIN_RESOLUTION, 1024)
    path = np.empty((len(coarse.frames), *start.shape), dtype=np.float32)
    path[0] = start
    mass = coarse.mass.astype(np.float64)
    flying = np.zeros(start.shape)
    times = coarse.frames * scene.frame_dt
    for row in range(1, len(path)):
        before, now = coarse.positions[row - 1].astype(np.float64), coarse.positions[row].astype(np.float64)
        step = times[row] - times[row - 1]
        flying = flying + np.array(scene.gravity) * step
        field, support = _carried(before, now - before, mass, path[row - 1], resolution)
        displacement = np.where((support > _SUPPORT)[:, None], field, flying * step)
        flying = displacement / step
        path[row] = np.clip(path[row - 1] + displacement, scene.walls.lower, scene.walls.upper)
    return path


def _carried(
    x: _Floats, displacement: _Floats, mass: _Floats, at: npt.NDArray[np.float32], resolution: int
) -> tuple[_Floats, _Floats]:
    """Displacement (N, D) of the points `at`, and the share (N,) of their weights on nodes with mass."""
    coarse, fine = Stencils.at(x, resolution), Stencils.at(at, resolution)
    grid_mass = coarse.scatter(mass)
    filled = grid_mass > 0
    support = fine.gather(filled.astype(np.float64))
    shift = [coarse.scatter(mass * column) / np.where(filled, grid_mass, 1.0) for column in displacement.T]
    gathered = np.stack([fine.gather(grid) for grid in shift], axis=1)
    return gathered / np.maximum(support, _SUPPORT)[:, None], support

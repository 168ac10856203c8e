"""Recordings with fewer states, and fine particles that are carried by the motion of coarse ones."""

import dataclasses

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.downsampling.merging import MIN_RESOLUTION
from hybridmpm.downsampling.splines import Stencils
from hybridmpm.errors import ConfigError
from hybridmpm.recording import Recording

_SUPPORT = 1e-3
"""Sum of a point's weights on nodes with mass that it must have for the grid to carry it [-]."""

_Floats = npt.NDArray[np.float64]


def strided(recording: Recording, r_t: int) -> Recording:
    """Return a recording with every `r_t`-th state of another, beginning with the first.

    Parameters
    ----------
    recording : Recording
        Recording of F states.
    r_t : int in [1, F]
        Number of states from one that is kept to the next.

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


def upsample(coarse: Recording, x: npt.ArrayLike, *, resolution: int) -> npt.NDArray[np.float32]:
    """Carry fine particles with the motion of a coarse recording.

    From one state to the next, the displacements of the coarse particles are put on the nodes of a grid, as
    P2G does with momentum, and interpolated to the fine particles, as G2P does with velocity. A fine particle
    without a node with mass nearby flies on under gravity. Fine particles stay within the walls, but may
    enter obstacles.

    Parameters
    ----------
    coarse : Recording
        F states of few particles. A particle should move by less than a few cells from one state to the next,
        so a recording of every frame is best.
    x : (N, D)
        Positions of the fine particles at the first state [m].
    resolution : int in [8, 1024]
        Cells per metre of the grid; the resolution of the coarse run is best.

    Returns
    -------
    float32 (F, N, D)
        Positions of the fine particles at each state [m]; the first are `x`.

    Raises
    ------
    ConfigError
        `x` has a wrong shape, or `resolution` is out of range.

    References
    ----------
    Jiang et al. 2016, "The material point method for simulating continuum materials": the PIC transfers, with
    displacements for velocities.
    """
    scene = coarse.scene
    start = np.asarray(x, dtype=np.float32)
    if start.ndim != 2 or start.shape[1] != scene.dim:
        raise ConfigError(f"x must have shape (N, {scene.dim}), got {start.shape}")
    whole("resolution", resolution, MIN_RESOLUTION, 1024)
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
    """Return displacements (N, D) [m] of the points `at`, and sums (N,) of weights on nodes with mass."""
    coarse, fine = Stencils.at(x, resolution), Stencils.at(at, resolution)
    grid_mass = coarse.scatter(mass)
    filled = grid_mass > 0
    support = fine.gather(filled.astype(np.float64))
    shift = [coarse.scatter(mass * column) / np.where(filled, grid_mass, 1.0) for column in displacement.T]
    gathered = np.stack([fine.gather(grid) for grid in shift], axis=1)
    return gathered / np.maximum(support, _SUPPORT)[:, None], support

"""The way back from fewer particles and frames: fine particles carried by coarse ones, and fewer states."""

import dataclasses

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import whole
from hybridmpm.downsampling.merging import MIN_RESOLUTION
from hybridmpm.downsampling.splines import Stencils
from hybridmpm.errors import ConfigError
from hybridmpm.recording import Recording

_SUPPORT = 1e-3
"""Share of a point's weights that must lie on nodes with mass for the grid to carry it."""

_Floats = npt.NDArray[np.float64]


def strided(recording: Recording, r_t: int) -> Recording:
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


def upsample(coarse: Recording, x: npt.ArrayLike, *, resolution: int) -> npt.NDArray[np.float32]:
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
    """Displacement (N, D) of the points `at`, and the share (N,) of their weights on nodes with mass."""
    coarse, fine = Stencils.at(x, resolution), Stencils.at(at, resolution)
    grid_mass = coarse.scatter(mass)
    filled = grid_mass > 0
    support = fine.gather(filled.astype(np.float64))
    shift = [coarse.scatter(mass * column) / np.where(filled, grid_mass, 1.0) for column in displacement.T]
    gathered = np.stack([fine.gather(grid) for grid in shift], axis=1)
    return gathered / np.maximum(support, _SUPPORT)[:, None], support

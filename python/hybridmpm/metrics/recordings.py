"""`compare`: most errors at once, between two recordings of one scene."""

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError
from hybridmpm.metrics.grid import grid_mass, grid_node_error, grid_nrmse, grid_rmse
from hybridmpm.metrics.particles import (
    centroid_error,
    density_extremes,
    energy_error,
    kinetic_energy,
    neighbour_histogram_distance,
    penetration_count,
    potential_energy,
)
from hybridmpm.recording import Recording

RADIUS = 2.0
"""Radius within which neighbours are counted, in mean spacings of the particles."""


def compare(predicted: Recording, true: Recording) -> dict[str, npt.NDArray[np.float64]]:
    """Return the errors of each state of a recording.

    Grids have the resolution of the true recording's scene.

    Parameters
    ----------
    predicted, true : Recording
        F states of the same frames; the numbers of particles may differ. `predicted` may be of a simulator
        with another grid.

    Returns
    -------
    dict of float64 (F,)
        - `grid_rmse`, `grid_nrmse`, `grid_node_error` [-];
        - `kinetic_energy`: `energy_error` of the kinetic energy [-];
        - `mechanical_energy`: `energy_error` of kinetic plus potential energy, the latter above the lowest
          corner of the walls [-]; elastic energy is left out, because recordings do not have it;
        - `centroid`: `centroid_error` [m];
        - `max_density`: largest density at a predicted particle over that at a true particle [-];
        - `neighbours`: `neighbour_histogram_distance` [neighbours], within `RADIUS` mean spacings of the
          recording's own particles;
        - `penetrations`: number of predicted particles inside obstacles or past walls.

    Raises
    ------
    ConfigError
        The frames or dimensions differ.
    """
    scene = true.scene
    if not np.array_equal(predicted.frames, true.frames) or predicted.scene.dim != scene.dim:
        raise ConfigError("predicted and true must have the same frames and scenes of the same dimension")
    both = (predicted, true)
    radius = RADIUS * scene.spacing
    wider = radius * (true.positions.shape[1] / predicted.positions.shape[1]) ** (1 / scene.dim)
    kinetic = [kinetic_energy(one.velocities, one.mass) for one in both]
    mechanical = [energy + _height_energy(one) for energy, one in zip(kinetic, both, strict=True)]
    density = [density_extremes(one.positions, one.mass, scene.resolution, scene.cells)[:, 1] for one in both]
    return {
        **_grid_errors(predicted, true),
        "kinetic_energy": energy_error(*kinetic),
        "mechanical_energy": energy_error(*mechanical),
        "centroid": centroid_error(predicted.positions, predicted.mass, true.positions, true.mass),
        "max_density": density[0] / density[1],
        "neighbours": neighbour_histogram_distance(
            predicted.positions, true.positions, radius, predicted_radius=wider
        ),
        "penetrations": _penetrations(predicted),
    }


def _grid_errors(predicted: Recording, true: Recording) -> dict[str, npt.NDArray[np.float64]]:
    """Return the grid errors, one state at a time: the grids of all states would take gigabytes in 3D."""
    measures = {"grid_rmse": grid_rmse, "grid_nrmse": grid_nrmse, "grid_node_error": grid_node_error}
    errors = {name: np.empty(len(true.frames)) for name in measures}
    scene = true.scene
    for row, (x, t) in enumerate(zip(predicted.positions, true.positions, strict=True)):
        grids = [
            grid_mass(one, two.mass, scene.resolution, scene.cells)
            for one, two in ((x, predicted), (t, true))
        ]
        for name, measure in measures.items():
            errors[name][row] = measure(*grids)
    return errors


def _penetrations(recording: Recording) -> npt.NDArray[np.float64]:
    counts = [
        penetration_count(recording.scene, x, first_frame=int(frame))
        for x, frame in zip(recording.positions, recording.frames, strict=True)
    ]
    return np.array(counts, dtype=np.float64)


def _height_energy(recording: Recording) -> npt.NDArray[np.float64]:
    """Return the potential energy (F,) [J] above the corner of the walls that is lowest under gravity."""
    scene = recording.scene
    gravity = np.array(scene.gravity)
    lowest = np.maximum(gravity * scene.walls.lower, gravity * scene.walls.upper).sum()
    mass = float(recording.mass.sum(dtype=np.float64))
    return np.asarray(potential_energy(recording.positions, recording.mass, scene.gravity) + mass * lowest)

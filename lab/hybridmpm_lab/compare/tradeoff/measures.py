"""The errors of the chart: of states from some frame on, against the truth."""

import dataclasses

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics
from hybridmpm.recording import Recording
from hybridmpm_lab.compare.accuracy.conventions import AT, EVERY

_GRID = {"error": "grid_rmse", "grid_nrmse": "grid_nrmse", "grid_node_error": "grid_node_error"}
"""Readings of the grid error, by their fields."""
_MEANS = ("kinetic_energy", "mechanical_energy", "centroid", "max_density")
FRONTS = {
    "error": "grid_rmse",
    "grid_nrmse": "grid_nrmse",
    "grid_node_error": "grid_node_error",
    "transport": "transport [m]",
    "kinetic_energy": "error of kinetic energy",
    "centroid": "error of the centroid [m]",
    "density_error": "error of the 99th percentile of density",
}
"""Errors by which there is a front and a chart, with their titles."""
MEASURES = (
    *(name for measure in (*_GRID, "transport") for name in (measure, *(f"{measure}_{at}" for at in AT))),
    *_MEANS,
    "density",
    "density_error",
)
"""All errors, by the names of their fields."""


def errors(predicted: Recording, true: Recording) -> dict[str, float]:
    """Compare every tenth state after some frame with the truth.

    Parameters
    ----------
    predicted, true : Recording
        States of the same frames, the first ten frames after the start.

    Returns
    -------
    dict
        Some of `MEASURES`, those of frames that are there. `error` is the mean of `grid_rmse` over the
        states, `error_40` that of the state 40 frames after the start; `grid_nrmse` and `grid_node_error` are
        the same for these readings. `transport_40` is the distance of transport [m] by an assignment of 300
        clusters, `transport` the mean over the frames of `AT`. `density` is the 99th percentile of the
        density at the particles over that at rest, the largest of these frames, `density_error` how far that
        percentile is from the truth's, over the truth's, as a mean of them. All others are means over the
        states of what `metrics.compare` measures.
    """
    measured = metrics.compare(predicted, true)
    rows = {frame: frame // EVERY - 1 for frame in AT if frame // EVERY <= len(true.frames)}
    found = {name: float(measured[name].mean()) for name in _MEANS}
    for field, measure in _GRID.items():
        found[field] = float(measured[measure].mean())
        found |= {f"{field}_{frame}": float(measured[measure][row]) for frame, row in rows.items()}
    moved = {f"transport_{frame}": _transport(predicted, true, row) for frame, row in rows.items()}
    dense, right = (_density(states, list(rows.values())) for states in (predicted, true))
    return {
        **found,
        **moved,
        "transport": float(np.mean(list(moved.values()))),
        "density": float(dense.max()),
        "density_error": float(np.mean(np.abs(dense / right - 1))),
    }


def after(run: Recording, start: int) -> Recording:
    """Return the states of a recording that come after frame `start`."""
    later = run.frames > start
    return dataclasses.replace(
        run, frames=run.frames[later], positions=run.positions[later], velocities=run.velocities[later]
    )


def _transport(predicted: Recording, true: Recording, row: int) -> float:
    return metrics.transport_distance(
        predicted.positions[row], predicted.mass, true.positions[row], true.mass
    )


def _density(states: Recording, rows: list[int]) -> npt.NDArray[np.float64]:
    """Return the 99th percentile of the density in some states, over that at rest [-]."""
    rest = {material.type_id: material.density for material in states.scene.materials}
    volumes = states.mass / np.array([rest[kind] for kind in states.types.tolist()])
    return metrics.density_percentile(states.positions[rows], volumes, states.scene.resolution)

"""Errors between states of a scene, bounds to judge errors by, and tables over many scenes.

A state is the positions x (N, D) [m] of its particles, where needed with their masses (N,) [kg] and
velocities v (N, D) [m/s]. Every measure also takes a whole trajectory x (F, N, D), the frames first; its
result then has the shape (F,). Two states may differ in the number of particles.

- `grid_rmse`, `grid_nrmse` and `grid_node_error` compare the masses that `grid_mass` puts on a grid.
  `grid_rmse` is the default error of this library.
- `sinkhorn_distance`, `sliced_distance`, `transport_distance`, `centroid_error`,
  `neighbour_histogram_distance` and `energy_error` compare particles.
- `kinetic_energy`, `potential_energy`, `density_extremes`, `density_percentile` and `penetration_count`
  measure one state.
- `compare` gives most of these errors between two recordings.
- `other_jitter`, `held_still` and `merged_states` give recordings for the floor and the ceiling of an error.
- `ErrorTable` collects means and standard errors over scenes, and paired differences between methods.
"""

from hybridmpm.metrics.assignment import transport_distance
from hybridmpm.metrics.bounds import held_still, merged_states, other_jitter
from hybridmpm.metrics.grid import EMPTY_BELOW, grid_mass, grid_node_error, grid_nrmse, grid_rmse
from hybridmpm.metrics.particles import (
    centroid_error,
    density_extremes,
    density_percentile,
    energy_error,
    kinetic_energy,
    neighbour_histogram_distance,
    penetration_count,
    potential_energy,
)
from hybridmpm.metrics.recordings import compare
from hybridmpm.metrics.sliced import sliced_distance
from hybridmpm.metrics.tables import ErrorTable, Estimate
from hybridmpm.metrics.transport import sinkhorn_distance

__all__ = [
    "EMPTY_BELOW",
    "ErrorTable",
    "Estimate",
    "centroid_error",
    "compare",
    "density_extremes",
    "density_percentile",
    "energy_error",
    "grid_mass",
    "grid_node_error",
    "grid_nrmse",
    "grid_rmse",
    "held_still",
    "kinetic_energy",
    "merged_states",
    "neighbour_histogram_distance",
    "other_jitter",
    "penetration_count",
    "potential_energy",
    "sinkhorn_distance",
    "sliced_distance",
    "transport_distance",
]

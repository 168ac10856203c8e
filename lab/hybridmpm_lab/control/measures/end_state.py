"""Where the fluid ended: errors against the truth, distance from the goal, mass inside, density."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm import metrics
from hybridmpm.coarse.splines import Stencils
from hybridmpm.control.goal.goal import Goal
from hybridmpm.scene import Scene
from hybridmpm_lab.harness.rows import Row

_SHORTEST = 0.02
"""Shortest displacement whose direction counts [m]."""
_DENSE = 99
"""Percentile that stands for the densest fluid; single particles do not set it."""

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EndStates:
    """Positions (N, D) [m] of the particles of one case."""

    scene: Scene
    mass: npt.NDArray[np.float32]
    """Masses (N,) [kg]."""
    goal: Goal
    """What the sketch asks for."""
    truth: npt.NDArray[np.float32] | None
    """Where the particles really came from; None where the sketch is free."""

    @property
    def target(self) -> npt.NDArray[np.floating]:
        """Where the particles are to be: as in truth, or where the sketch wants them."""
        return self.goal.paths.places if self.truth is None else self.truth

    def measure(self, x: npt.NDArray[np.floating], later: npt.NDArray[np.floating] | None) -> Row:
        """Measure positions at the end (N, D), and the mass inside of the goal some frames later.

        `error`, `nrmse` and `node_error` are `grid_rmse`, `grid_nrmse` and `grid_node_error` against the
        truth; `transport` [m] is the distance of 300 clusters from the target; `inside` and `inside_later`
        are shares of the mass; `centroid_error` [m] is the distance of the centre of mass from where the
        sketch wants it, `direction_error` [degrees] the angle between its displacement and the wanted one;
        `density_ratio` is the 99th percentile of the density over that of the truth, or of the start.
        """
        goal = self.goal
        reference = goal.cloud.x if self.truth is None else self.truth
        return {
            **self._grid_errors(x),
            "transport": metrics.transport_distance(x, self.mass, self.target, self.mass),
            "inside": self._inside(x),
            "inside_later": None if later is None else self._inside(later),
            **self._centroid_errors(x),
            "density_ratio": self._density(x) / self._density(reference),
        }

    def _grid_errors(self, x: npt.NDArray[np.floating]) -> Row:
        names = {
            "error": metrics.grid_rmse,
            "nrmse": metrics.grid_nrmse,
            "node_error": metrics.grid_node_error,
        }
        if self.truth is None:
            return dict.fromkeys(names)
        mine, true = (metrics.grid_mass(state, self.mass, self.scene.resolution) for state in (x, self.truth))
        return {name: measure(mine, true) for name, measure in names.items()}

    def _inside(self, x: npt.NDArray[np.floating]) -> float | None:
        inside = self.goal.inside(np.asarray(x, dtype=np.float64))
        return None if inside is None else float(self.goal.cloud.weight @ inside)

    def _centroid_errors(self, x: npt.NDArray[np.floating]) -> Row:
        goal = self.goal
        moved = goal.cloud.weight @ np.asarray(x, dtype=np.float64) - goal.cloud.centroid
        wanted = goal.target_displacement
        lengths = float(np.linalg.norm(moved)), float(np.linalg.norm(wanted))
        angle = None
        if lengths[1] >= _SHORTEST and lengths[0] > 0:
            cosine = float(moved @ wanted) / lengths[0] / lengths[1]
            angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
        return {"centroid_error": float(np.linalg.norm(moved - wanted)), "direction_error": angle}

    def _density(self, x: npt.NDArray[np.floating]) -> float:
        return float(np.percentile(densities(x, self.mass, self.scene.resolution), _DENSE))


def densities(
    x: npt.NDArray[np.floating], mass: npt.NDArray[np.floating], resolution: int
) -> npt.NDArray[np.float64]:
    """Return the density of the grid at particles (N,) [kg/m^D], interpolated by quadratic B-splines."""
    stencils = Stencils.at(x, resolution)
    grid = stencils.scatter(np.asarray(mass, dtype=np.float64))
    return np.asarray(stencils.gather(grid) * float(resolution) ** x.shape[1])


def distance_from_path(centroids: _Floats, path: _Floats) -> float:
    """Return the mean distance [m] of points (T, D) from a polyline (K, D)."""
    starts, legs = path[:-1], np.diff(path, axis=0)
    square = np.maximum((legs**2).sum(axis=1), 1e-18)
    along = np.einsum("tkd,kd->tk", centroids[:, None] - starts, legs) / square
    nearest = starts + np.clip(along, 0, 1)[..., None] * legs
    return float(np.linalg.norm(centroids[:, None] - nearest, axis=2).min(axis=1).mean())

"""Measures of particles: energies, centroid, density, spacing and penetration."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm import _native
from hybridmpm._support.arguments import float32, whole
from hybridmpm.downsampling.splines import Stencils
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene

_Floats = npt.NDArray[np.float64]


def kinetic_energy(v: npt.ArrayLike, mass: npt.ArrayLike) -> _Floats:
    """Sum of m |v|^2 / 2.

    Parameters
    ----------
    v : (N, D) or (F, N, D)
        Velocities [m/s].
    mass : (N,)
        [kg].

    Returns
    -------
    float64 () or (F,), >= 0
        [J]; in 2D of a slice one metre deep.

    Raises
    ------
    ConfigError
        Wrong shapes.
    """
    velocity, masses = checked_particles("v", v, mass)
    return np.asarray(0.5 * ((velocity**2).sum(axis=-1) * masses).sum(axis=-1))


def potential_energy(x: npt.ArrayLike, mass: npt.ArrayLike, gravity: Sequence[float]) -> _Floats:
    """-Sum of m g . x, zero at the origin, as in `Diagnostics`.

    Parameters
    ----------
    x : (N, D) or (F, N, D)
        Positions [m].
    mass : (N,)
        [kg].
    gravity : D floats
        [m/s^2].

    Returns
    -------
    float64 () or (F,)
        [J].

    Raises
    ------
    ConfigError
        Wrong shapes.
    """
    positions, masses = checked_particles("x", x, mass)
    if len(gravity) != positions.shape[-1]:
        raise ConfigError(f"gravity must have {positions.shape[-1]} numbers, got {len(gravity)}")
    return np.asarray(-((positions @ np.asarray(gravity, dtype=np.float64)) * masses).sum(axis=-1))


def energy_error(predicted: npt.ArrayLike, true: npt.ArrayLike) -> _Floats:
    """|E_pred - E_true| / max E_true, of kinetic, total or any energy that is zero at rest.

    Parameters
    ----------
    predicted, true : (F,)
        Energies over F frames [J], e.g. from `kinetic_energy` or `Diagnostics`.

    Returns
    -------
    float64 (F,), >= 0
        [-], in parts of the largest true energy of all frames: a fluid at rest has none of its own to divide
        by.

    Raises
    ------
    ConfigError
        Shapes differ, a value is not finite, or the largest true energy is not above 0.
    """
    p, t = np.asarray(predicted, dtype=np.float64), np.asarray(true, dtype=np.float64)
    if p.shape != t.shape or p.ndim != 1 or len(p) == 0:
        raise ConfigError(f"predicted and true must have the same shape (F,), got {p.shape} and {t.shape}")
    if not (np.isfinite(p).all() and np.isfinite(t).all() and t.max() > 0):
        raise ConfigError("energies must be finite, and the largest true one above 0 J")
    return np.asarray(np.abs(p - t) / t.max())


def centroid_error(
    predicted: npt.ArrayLike, predicted_mass: npt.ArrayLike, true: npt.ArrayLike, true_mass: npt.ArrayLike
) -> _Floats:
    """Distance of the centres of mass.

    Parameters
    ----------
    predicted, true : (N, D) or (F, N, D)
        Positions [m]; N may differ.
    predicted_mass, true_mass : (N,)
        [kg].

    Returns
    -------
    float64 () or (F,), >= 0
        [m].

    Raises
    ------
    ConfigError
        Wrong shapes.
    """
    centres = []
    for name, x, mass in (("predicted", predicted, predicted_mass), ("true", true, true_mass)):
        positions, masses = checked_particles(name, x, mass)
        centres.append((positions * masses[:, None]).sum(axis=-2) / masses.sum())
    if centres[0].shape != centres[1].shape:
        raise ConfigError("predicted and true must have the same dimension and number of frames")
    return np.asarray(np.linalg.norm(centres[0] - centres[1], axis=-1))


def density_extremes(x: npt.ArrayLike, mass: npt.ArrayLike, resolution: int) -> _Floats:
    """Smallest and largest density that a particle sees around it.

    The density is that of the grid, mass per cell, interpolated to the particles by quadratic B-splines. At a
    free surface or a wall it is about half of that inside.

    Parameters
    ----------
    x : (N, D) or (F, N, D), in [0, 1]
        Positions [m].
    mass : (N,)
        [kg].
    resolution : int in [8, 1024]
        Cells along each axis; with less than one particle a cell the density shows the gaps.

    Returns
    -------
    float64 (2,) or (F, 2), > 0
        Smallest, largest [kg/m^3].

    Raises
    ------
    ConfigError
        Wrong shapes or values out of range.
    """
    positions, masses = checked_particles("x", x, mass)
    resolution = whole("resolution", resolution, 8, 1024)
    if not ((positions >= 0) & (positions <= 1)).all():
        raise ConfigError("x must be in [0, 1] m")

    def extremes(frame: _Floats) -> tuple[float, float]:
        stencils = Stencils.at(frame, resolution)
        density = stencils.gather(stencils.scatter(masses)) * float(resolution) ** frame.shape[1]
        return density.min(), density.max()

    return _by_frame(extremes, positions)


def neighbour_histogram_distance(
    predicted: npt.ArrayLike, true: npt.ArrayLike, radius: float, *, predicted_radius: float | None = None
) -> _Floats:
    """Earth mover's distance between the histograms of the particles' numbers of neighbours.

    Parameters
    ----------
    predicted, true : (N, D) or (F, N, D)
        Positions [m]; N may differ.
    radius : float > 0
        Neighbours are at most so far away [m].
    predicted_radius : float > 0, optional
        Another radius for the predicted particles, where their spacing is another.

    Returns
    -------
    float64 () or (F,), >= 0
        [neighbours]: by how many the numbers differ in the mean, once both are sorted.

    Raises
    ------
    ConfigError
        Wrong shapes, or a radius that is not above 0.

    References
    ----------
    Rubner et al. 2000, "The earth mover's distance as a metric for image retrieval"; in one dimension the
    area between the cumulative histograms.
    """
    p, t = (float32(name, x, "(N, D)", "(F, N, D)") for name, x in (("predicted", predicted), ("true", true)))
    if p.ndim != t.ndim or (p.ndim == 3 and len(p) != len(t)):
        raise ConfigError(f"predicted and true must have as many frames, got {p.shape} and {t.shape}")
    pairs = [(p, t)] if p.ndim == 2 else list(zip(p, t, strict=True))
    reach = radius if predicted_radius is None else predicted_radius
    distances = [_earth_movers(_shares(one, reach), _shares(two, radius)) for one, two in pairs]
    return np.array(distances).reshape(p.shape[:-2])


def _shares(x: npt.NDArray[np.float32], radius: float) -> _Floats:
    """Share of the particles that have 0, 1, 2, ... neighbours."""
    receivers = _native.radius_graph(x, radius).receivers
    return np.asarray(np.bincount(np.bincount(receivers, minlength=len(x))) / len(x))


def _earth_movers(one: _Floats, two: _Floats) -> float:
    length = max(len(one), len(two))
    difference = np.pad(one, (0, length - len(one))) - np.pad(two, (0, length - len(two)))
    return float(np.abs(np.cumsum(difference)).sum())


def penetration_count(
    scene: Scene, x: npt.ArrayLike, *, first_frame: int = 0, every: int = 1, tolerance: float = 1e-6
) -> npt.NDArray[np.int64]:
    """Count the particles inside obstacles or past walls.

    Parameters
    ----------
    scene : Scene
    x : (N, D) or (F, N, D)
        Positions [m].
    first_frame, every : int
        Number of the first frame, and frames from one to the next: obstacles may move.
    tolerance : float >= 0
        Depth that is let pass [m]; by default the rounding of particles that lie on a surface.

    Returns
    -------
    int64 () or (F,), in [0, N]

    Raises
    ------
    ConfigError
        Wrong shapes.
    """
    positions = float32("x", x, "(N, D)", "(F, N, D)")
    if positions.shape[-1] != scene.dim:
        raise ConfigError(f"x must have {scene.dim} coordinates, got shape {positions.shape}")
    lower, upper = np.array(scene.walls.lower) - tolerance, np.array(scene.walls.upper) + tolerance
    past = ((positions < lower) | (positions > upper)).any(axis=-1)
    frames = past.reshape(-1, positions.shape[-2])
    for obstacle in scene.obstacles:
        solid = obstacle.to_native()
        for row, frame in enumerate(positions.reshape(-1, *positions.shape[-2:])):
            time = (first_frame + row * every) * scene.frame_dt
            frames[row] |= solid.signed_distance(frame, time) < -tolerance
    return np.asarray(past.sum(axis=-1))


def checked_particles(name: str, x: npt.ArrayLike, mass: npt.ArrayLike) -> tuple[_Floats, _Floats]:
    """Return values (N, D) or (F, N, D) of particles and their mass (N,), or raise `ConfigError`."""
    values = float32(name, x, "(N, D)", "(F, N, D)").astype(np.float64)
    masses = float32("mass", mass, "(N,)").astype(np.float64)
    if not np.isfinite(values).all():
        raise ConfigError(f"{name} must be finite")
    if len(masses) != values.shape[-2] or not (np.isfinite(masses) & (masses > 0)).all():
        raise ConfigError(
            f"mass must be a number > 0 for each of the {values.shape[-2]} particles of {name}, "
            f"got shape {masses.shape}"
        )
    return values, masses


def _by_frame(measure: Callable[[_Floats], tuple[float, ...]], x: _Floats) -> _Floats:
    rows = [measure(frame) for frame in x.reshape(-1, *x.shape[-2:])]
    return np.array(rows).reshape(*x.shape[:-2], -1)

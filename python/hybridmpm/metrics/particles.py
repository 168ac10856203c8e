"""Measures of particles: energies, centre of mass, density, neighbours and penetration."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm._support.arguments import float32, float64, whole
from hybridmpm.coarse.splines import Stencils
from hybridmpm.errors import ConfigError
from hybridmpm.metrics.grid import grid_cells
from hybridmpm.scene import Scene

_Floats = npt.NDArray[np.float64]


def kinetic_energy(v: npt.ArrayLike, mass: npt.ArrayLike) -> _Floats:
    """Return the kinetic energy, the sum of m |v|^2 / 2.

    Parameters
    ----------
    v : (N, D) or (F, N, D)
        Velocities [m/s].
    mass : (N,)
        Masses [kg].

    Returns
    -------
    float64 () or (F,), >= 0
        Energy [J]; in 2D that of a slice one metre deep.

    Raises
    ------
    ConfigError
        A shape is wrong, a velocity is not finite, or a mass is not above 0.
    """
    velocity, masses = checked_particles("v", v, mass)
    return np.asarray(0.5 * ((velocity**2).sum(axis=-1) * masses).sum(axis=-1))


def potential_energy(x: npt.ArrayLike, mass: npt.ArrayLike, gravity: npt.ArrayLike) -> _Floats:
    """Return the potential energy, minus the sum of m g . x, which is zero at the origin as in `Diagnostics`.

    Parameters
    ----------
    x : (N, D) or (F, N, D)
        Positions [m].
    mass : (N,)
        Masses [kg].
    gravity : (D,)
        Gravity g [m/s^2].

    Returns
    -------
    float64 () or (F,)
        Energy [J]; in 2D that of a slice one metre deep.

    Raises
    ------
    ConfigError
        A shape is wrong, a position is not finite, or a mass is not above 0.
    """
    positions, masses = checked_particles("x", x, mass)
    g = float64("gravity", gravity)
    if g.shape != positions.shape[-1:]:
        raise ConfigError(f"gravity must have shape {positions.shape[-1:]}, got {g.shape}")
    return np.asarray(-((positions @ g) * masses).sum(axis=-1))


def energy_error(predicted: npt.ArrayLike, true: npt.ArrayLike) -> _Floats:
    """Return |E_pred - E_true| / max E_true of kinetic, total or any other energy that is zero at rest.

    The error is divided by the largest true energy of all frames, because the energy of a frame at rest
    is 0.

    Parameters
    ----------
    predicted, true : (F,)
        Energies of F frames [J], e.g. from `kinetic_energy` or `Diagnostics`.

    Returns
    -------
    float64 (F,), >= 0
        Error of each frame [-].

    Raises
    ------
    ConfigError
        Shapes differ, a value is not finite, or the largest true energy is not above 0.
    """
    p, t = float64("predicted", predicted), float64("true", true)
    if p.shape != t.shape or p.ndim != 1 or len(p) == 0:
        raise ConfigError(f"predicted and true must have the same shape (F,), got {p.shape} and {t.shape}")
    if not (np.isfinite(p).all() and np.isfinite(t).all() and t.max() > 0):
        raise ConfigError("energies must be finite, and the largest true one above 0 J")
    return np.asarray(np.abs(p - t) / t.max())


def centroid_error(
    predicted: npt.ArrayLike, predicted_mass: npt.ArrayLike, true: npt.ArrayLike, true_mass: npt.ArrayLike
) -> _Floats:
    """Return the distance between the centres of mass.

    Parameters
    ----------
    predicted, true : (N, D) or (F, N, D)
        Positions [m]; N may differ.
    predicted_mass, true_mass : (N,)
        Masses [kg].

    Returns
    -------
    float64 () or (F,), >= 0
        Distance [m].

    Raises
    ------
    ConfigError
        A shape is wrong, a position is not finite, or a mass is not above 0.
    """
    centres = []
    for name, x, mass in (("predicted", predicted, predicted_mass), ("true", true, true_mass)):
        positions, masses = checked_particles(name, x, mass)
        centres.append((positions * masses[:, None]).sum(axis=-2) / masses.sum())
    if centres[0].shape != centres[1].shape:
        raise ConfigError("predicted and true must have the same dimension and number of frames")
    return np.asarray(np.linalg.norm(centres[0] - centres[1], axis=-1))


def density_extremes(
    x: npt.ArrayLike, mass: npt.ArrayLike, resolution: int, cells: Sequence[int] | None = None
) -> _Floats:
    """Return the smallest and the largest density at a particle.

    The density is the mass of a grid node over the volume of a cell, interpolated to the particles by
    quadratic B-splines. At a free surface or a wall it is about half of the density inside.

    Parameters
    ----------
    x : (N, D) or (F, N, D), inside the world
        Positions [m].
    mass : (N,)
        Masses [kg].
    resolution : int in [1, 1000000], without `cells` in [8, 4096]
        Number of cells per metre. With less than one particle in a cell the density shows the gaps between
        particles.
    cells : D integers in [8, 4096], optional
        Number of cells along each axis, as `Scene.cells`; those of one metre if absent.

    Returns
    -------
    float64 (2,) or (F, 2), > 0
        Smallest and largest density [kg/m^3].

    Raises
    ------
    ConfigError
        A shape is wrong, or a value is out of range.
    """
    return _of_densities(
        lambda density: (float(density.min()), float(density.max())), x, mass, resolution, cells
    )


def density_percentile(
    x: npt.ArrayLike,
    mass: npt.ArrayLike,
    resolution: int,
    percentile: float = 99.0,
    cells: Sequence[int] | None = None,
) -> _Floats:
    """Return a percentile of the density at the particles, that of `density_extremes`.

    Parameters and errors are those of `density_extremes`; `percentile` is in [0, 100]. The result has the
    shape () or, of F frames, (F,) [kg/m^3].
    """
    if not 0 <= percentile <= 100:
        raise ConfigError(f"percentile must be in [0, 100], got {percentile!r}")

    def high(density: _Floats) -> tuple[float]:
        return (float(np.percentile(density, percentile)),)

    return _of_densities(high, x, mass, resolution, cells)[..., 0]


def _of_densities(
    measure: Callable[[_Floats], tuple[float, ...]],
    x: npt.ArrayLike,
    mass: npt.ArrayLike,
    resolution: int,
    cells: Sequence[int] | None,
) -> _Floats:
    """Return what `measure` says of the densities (N,) at the particles, frame by frame."""
    positions, masses = checked_particles("x", x, mass)
    resolution = whole("resolution", resolution, 1, 1_000_000)
    counts = grid_cells(positions.shape[-1], resolution, cells)
    upper = np.array(counts) / resolution
    if not ((positions >= 0) & (positions <= upper)).all():
        room = "[0, 1] m" if cells is None else f"the world, up to {upper.tolist()} m"
        raise ConfigError(f"x must be in {room}")

    def of_frame(frame: _Floats) -> tuple[float, ...]:
        stencils = Stencils.at(frame, resolution, counts)
        density = stencils.gather(stencils.scatter(masses)) * float(resolution) ** frame.shape[1]
        return measure(density)

    return _by_frame(of_frame, positions)


def neighbour_histogram_distance(
    predicted: npt.ArrayLike, true: npt.ArrayLike, radius: float, *, predicted_radius: float | None = None
) -> _Floats:
    """Return the earth mover's distance between the histograms of the particles' numbers of neighbours.

    Parameters
    ----------
    predicted, true : (N, D) or (F, N, D)
        Positions [m]; N may differ.
    radius : float > 0
        Largest distance of neighbours [m].
    predicted_radius : float > 0, optional
        Largest distance of neighbours among the predicted particles [m]; `radius` if absent. It differs where
        the spacing of the predicted particles differs.

    Returns
    -------
    float64 () or (F,), >= 0
        Distance [neighbours]: the mean difference of the numbers of neighbours, once both are sorted.

    Raises
    ------
    ConfigError
        A shape is wrong, or a radius is not above 0.

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
    distances = [_earth_movers(_histogram(one, reach), _histogram(two, radius)) for one, two in pairs]
    return np.array(distances).reshape(p.shape[:-2])


def _histogram(x: npt.NDArray[np.float32], radius: float) -> _Floats:
    """Return the fraction of the particles that have 0, 1, 2, ... neighbours."""
    receivers = _core.radius_graph(x, radius).receivers
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
        Scene with the walls and obstacles.
    x : (N, D) or (F, N, D)
        Positions [m].
    first_frame, every : int
        Frame number of the first state, and number of frames from one state to the next; they place moving
        obstacles.
    tolerance : float >= 0
        Depth up to which a particle does not count [m]; by default the rounding of particles on a surface.

    Returns
    -------
    int64 () or (F,), in [0, N]
        Number of particles.

    Raises
    ------
    ConfigError
        `x` has a wrong shape.
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
    """Return values (N, D) or (F, N, D) of particles and their masses (N,) as float64.

    Raises
    ------
    ConfigError
        A shape is wrong, a value is not finite, or a mass is not above 0.
    """
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

"""Density and pressure, at points and in patches.

The density at a point x counts the mass of particles by the weight prod_axis N((x_p - x) / h), where N is the
quadratic B-spline (Jiang et al. 2016, Eq. 123), which reaches 1.5 h far. `fit` has pressures.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hybridmpm.probes.fit import FIT, fitted_pressure
from hybridmpm.probes.probe import (
    Floats,
    Probe,
    Probed,
    between_walls,
    checked_patch,
    checked_points,
    lattice,
    outline,
    outside_of_obstacles,
    overlap,
)
from hybridmpm.scene import Scene

_WIDTH = 3.0
"""Length h of the weights of a density [spacings]."""
_SUPPORT = 1.5
"""Distance along an axis from which on a weight is zero [h]."""
_SAMPLES = 24
"""Points along each axis at which the room beside obstacles is looked at."""
_LEAST_ROOM = 0.05
"""Part of a weight outside of walls and obstacles below which there is nothing to read [-]."""


@dataclass(frozen=True, eq=False)
class Density(Probe):
    """Density at points [kg/m^3].

    Mass in reach over the room in reach, that behind walls and in obstacles left out; half of the density
    of the bulk at a free surface, and NaN inside obstacles.
    """

    points: npt.ArrayLike
    """One point (D,), or K of them (K, D) [m]."""
    unit: ClassVar[str] = "kg/m^3"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        checked_points("points", self.points, scene)

    def read(self, simulator: Probed) -> Floats:
        """Return the densities, () for one point, else (K,)."""
        scene = simulator.scene
        points = checked_points("points", self.points, scene)
        h = _WIDTH * simulator.particle_spacing
        x, mass = simulator.positions, simulator.mass
        values = np.empty(len(points))
        for row, point in enumerate(points):
            near = _near(x, point, _SUPPORT * h)
            held = float(mass[near] @ _weights(x[near] - point, h)) / h**scene.dim
            room = _room(point, h, simulator)
            values[row] = held / room if room > _LEAST_ROOM else np.nan
        return _shaped(values, self.points)

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        points = checked_points("points", self.points, simulator.scene).tolist()
        return {
            "kind": "density",
            "points": points,
            "width": _WIDTH * simulator.particle_spacing,
            "support": _SUPPORT,
            "samples": _SAMPLES,
            "least": _LEAST_ROOM,
            "marks": [[point] for point in points],
        }


@dataclass(frozen=True, eq=False)
class PatchDensity(Probe):
    """Mean density in a box: the mass in it over its volume outside of obstacles [kg/m^3]."""

    lower: npt.ArrayLike
    """Corner (D,) with the smallest coordinates [m]."""
    upper: npt.ArrayLike
    """Corner (D,) with the largest coordinates [m]."""
    unit: ClassVar[str] = "kg/m^3"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        checked_patch(self.lower, self.upper, scene)

    def read(self, simulator: Probed) -> Floats:
        """Return the density, (); NaN where the box lies within obstacles."""
        lower, upper = checked_patch(self.lower, self.upper, simulator.scene)
        size = simulator.particle_spacing
        part = overlap(between_walls(simulator.positions, size, simulator.scene), size, lower, upper)
        room = free_volume(lower, upper, simulator)
        return np.array(float(simulator.mass @ part) / room if room > 0 else np.nan)

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        return {"kind": "patch density", **plain_patch(self.lower, self.upper, simulator)}


@dataclass(frozen=True, eq=False)
class Pressure(Probe):
    """Pressure at points [Pa]: that of MPM's stress, above 0 in compression; 0 where there is no material.

    A linear function is fitted to the pressures in reach, so that at a surface the reading is that of the
    surface, not of the particles beside it. What lies behind the nearest face of an obstacle is out of reach.
    In a spray, where too few are in reach for a fit, it is their mean.
    """

    points: npt.ArrayLike
    """One point (D,), or K of them (K, D) [m]."""
    unit: ClassVar[str] = "Pa"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        checked_points("points", self.points, scene)

    def read(self, simulator: Probed) -> Floats:
        """Return the pressures, () for one point, else (K,).

        Raises
        ------
        ConfigError
            The simulator has no pressure, because a network moves its particles, or may.
        """
        points = checked_points("points", self.points, simulator.scene)
        samples = simulator.pressure_samples()
        values = [fitted_pressure(samples, point, simulator) for point in points]
        return _shaped(np.array(values), self.points)

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        points = checked_points("points", self.points, simulator.scene).tolist()
        return {
            "kind": "pressure",
            "points": points,
            "spacing": simulator.pressure_samples().spacing,
            **FIT,
            "marks": [[point] for point in points],
        }


@dataclass(frozen=True, eq=False)
class PatchPressure(Probe):
    """Mean pressure of the material in a box [Pa]; 0 where there is none."""

    lower: npt.ArrayLike
    """Corner (D,) with the smallest coordinates [m]."""
    upper: npt.ArrayLike
    """Corner (D,) with the largest coordinates [m]."""
    unit: ClassVar[str] = "Pa"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        checked_patch(self.lower, self.upper, scene)

    def read(self, simulator: Probed) -> Floats:
        """Return the pressure, (); errors as of `Pressure.read`."""
        lower, upper = checked_patch(self.lower, self.upper, simulator.scene)
        samples = simulator.pressure_samples()
        x = between_walls(samples.x, samples.spacing, simulator.scene)
        part = overlap(x, samples.spacing, lower, upper)
        total = float(part.sum())
        return np.array(float(samples.pressure @ part) / total if total > 0 else 0.0)

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        return {"kind": "patch pressure", **plain_patch(self.lower, self.upper, simulator)}


def plain_patch(lower: npt.ArrayLike, upper: npt.ArrayLike, simulator: Probed) -> dict[str, Any]:
    """Return what `Probe.plain` says of a box."""
    low, high = checked_patch(lower, upper, simulator.scene)
    return {
        "lower": low.tolist(),
        "upper": high.tolist(),
        "samples": _samples(simulator.scene),
        "marks": [outline(low, high)],
    }


def free_volume(lower: Floats, upper: Floats, simulator: Probed) -> float:
    """Return how much of a box lies outside of obstacles [m^D]."""
    whole = float(np.prod(upper - lower))
    if not simulator.scene.obstacles:
        return whole
    cells = lattice(lower, upper, _samples(simulator.scene))
    return whole * float(outside_of_obstacles(cells, simulator).mean())


def _samples(scene: Scene) -> int:
    """Return the number of points along each axis at which the room of a box is looked at."""
    return 128 if scene.dim == 2 else 32


def _near(x: npt.NDArray[np.float32], point: Floats, reach: float) -> npt.NDArray[np.bool_]:
    return np.asarray((np.abs(x - point) < reach).all(axis=1))


def _weights(offsets: Floats, h: float) -> Floats:
    """Return the weights (n,) at offsets (n, D) [m]; their integral over space is h^D."""
    u = np.abs(offsets) / h
    along = np.where(u < 0.5, 0.75 - u**2, 0.5 * np.clip(_SUPPORT - u, 0, None) ** 2)
    return np.asarray(along.prod(axis=1))


def _room(point: Floats, h: float, simulator: Probed) -> float:
    """Return which part of the weights around a point lies between the walls and outside of obstacles."""
    scene = simulator.scene
    lower, upper = (np.array(corner) for corner in (scene.walls.lower, scene.walls.upper))
    between = _cumulative((upper - point) / h) - _cumulative((lower - point) / h)
    room = float(between.prod())
    if scene.obstacles:
        reach = _SUPPORT * h
        x = lattice(np.maximum(point - reach, lower), np.minimum(point + reach, upper), _SAMPLES)
        weights = _weights(x - point, h)
        room *= float(weights @ outside_of_obstacles(x, simulator)) / float(weights.sum())
    return room


def _cumulative(t: Floats) -> Floats:
    """Return the integral of the quadratic B-spline from minus infinity to t."""
    middle = 0.5 + t * (0.75 - t**2 / 3)
    below, above = np.clip(t + 1.5, 0, None) ** 3 / 6, 1 - np.clip(1.5 - t, 0, None) ** 3 / 6
    return np.where(np.abs(t) < 0.5, middle, np.where(t < 0, below, above))


def _shaped(values: Floats, points: npt.ArrayLike) -> Floats:
    return values[0:1].reshape(()) if np.ndim(points) == 1 else values

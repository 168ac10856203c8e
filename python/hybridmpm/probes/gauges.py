"""Gauges of amounts: the height of a surface, the filling of a box, the flow through a segment."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import float64, whole
from hybridmpm.errors import ConfigError
from hybridmpm.probes.probe import (
    Floats,
    Probe,
    Probed,
    between_walls,
    checked_patch,
    checked_points,
    overlap,
)
from hybridmpm.probes.quantities import free_volume, plain_patch
from hybridmpm.scene import Scene
from hybridmpm.scene.rigid import placed

_COLUMN = 4.0
"""Width of the column of a height gauge [spacings]."""
_BAND = 4.0
"""Thickness of the band around a segment in which a flow is read [spacings]."""
_STEPS = 4
"""Heights at which a column is looked at, for each spacing."""
_BESIDE = 6.0
"""Distance of a column from the rigid body that it is beside [spacings]."""


@dataclass(frozen=True, eq=False)
class HeightGauge(Probe):
    """Height of the free surface above the floor at a place [m]; 0 where there is no material.

    The surface is the highest level at which a column, four particle spacings wide, is half full: spray above
    it does not count, and what lies on an obstacle does.
    """

    place: float | npt.ArrayLike
    """The D - 1 coordinates across gravity [m]: x in 2D; x and z in 3D, where gravity acts along y."""
    unit: ClassVar[str] = "m"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        self._column(scene, 1e-3)

    def _column(self, scene: Scene, width: float) -> tuple[int, Floats, Floats]:
        """Return the axis of gravity, and lower and upper corner (D,) of the column between the walls."""
        up = _up(scene)
        place = np.atleast_1d(float64("place", self.place))
        if place.shape != (scene.dim - 1,):
            raise ConfigError(
                f"place must be the {scene.dim - 1} coordinates across gravity in {scene.dim}D, got "
                f"{self.place!r}"
            )
        low, high = np.array(scene.walls.lower), np.array(scene.walls.upper)
        point = checked_points("place", np.insert(place, up, low[up]), scene)[0]
        across = np.arange(scene.dim) != up
        low[across] = np.maximum(low, point - width / 2)[across]
        high[across] = np.minimum(high, point + width / 2)[across]
        return up, low, high

    def read(self, simulator: Probed) -> Floats:
        """Return the height, ()."""
        scene, size = simulator.scene, simulator.particle_spacing
        up, low, high = self._column(scene, _COLUMN * size)
        x = between_walls(simulator.positions, size, scene)
        # Heights above the floor, whichever way gravity points.
        floor_is_low = scene.gravity[up] < 0
        height = x[:, up] - low[up] if floor_is_low else high[up] - x[:, up]
        part = overlap(np.delete(x, up, 1), size, np.delete(low, up), np.delete(high, up))
        area = float(np.prod(np.delete(high - low, up)))
        inside = part > 0
        volume, height = part[inside] * size**scene.dim, height[inside]
        levels = np.arange(0.0, high[up] - low[up] + size, size / _STEPS)
        # A window of two spacings is half full where its middle lies on the surface.
        filling = np.zeros(len(levels))
        for row, level in enumerate(levels):
            within = np.minimum(height + size / 2, level + size) - np.maximum(height - size / 2, level - size)
            filling[row] = volume @ np.clip(within / size, 0, 1) / (area * min(level + size, 2 * size))
        full = np.flatnonzero(filling >= 0.5)
        if len(full) == 0:
            return np.array(0.0)
        last = int(full[-1])
        if last + 1 == len(levels):
            return np.array(float(high[up] - low[up]))
        step = (filling[last] - 0.5) / (filling[last] - filling[last + 1])
        return np.array(float(levels[last] + step * (levels[last + 1] - levels[last])))

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        scene = simulator.scene
        up, low, high = self._column(scene, _COLUMN * simulator.particle_spacing)
        foot, head = (low + high) / 2, (low + high) / 2
        foot[up], head[up] = low[up], high[up]
        return {
            "kind": "height",
            "up": up,
            "floorIsLow": scene.gravity[up] < 0,
            "lower": low.tolist(),
            "upper": high.tolist(),
            "steps": _STEPS,
            "marks": [[foot.tolist(), head.tolist()]],
        }


@dataclass(frozen=True, eq=False)
class FillLevel(Probe):
    """Part of a box that material fills, what is outside of obstacles counting as the whole [-].

    Volumes are those at rest, so that water that is compressed by 1 % fills a box by 1.01.
    """

    lower: npt.ArrayLike
    """Corner (D,) with the smallest coordinates [m]."""
    upper: npt.ArrayLike
    """Corner (D,) with the largest coordinates [m]."""
    unit: ClassVar[str] = "1"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        checked_patch(self.lower, self.upper, scene)

    def read(self, simulator: Probed) -> Floats:
        """Return the part, (); NaN where the box lies within obstacles."""
        scene, size = simulator.scene, simulator.particle_spacing
        lower, upper = checked_patch(self.lower, self.upper, scene)
        filled = float(overlap(between_walls(simulator.positions, size, scene), size, lower, upper).sum())
        room = free_volume(lower, upper, simulator)
        return np.array(filled * size**scene.dim / room if room > 0 else np.nan)

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        return {"kind": "fill level", **plain_patch(self.lower, self.upper, simulator)}


@dataclass(frozen=True, eq=False)
class Submerged(Probe):
    """Part of a rigid body's volume that lies below the free surface beside it [-].

    The surface is the mean of a `HeightGauge` on either side of the body, in 3D on four sides, six particle
    spacings from it; a side without so much room counts as none. NaN where no side has it.
    """

    body: int
    """Index into `Scene.rigid`."""
    unit: ClassVar[str] = "1"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        self._facets(scene)
        HeightGauge(np.delete(scene.walls.lower, _up(scene))).check(scene)

    def _facets(self, scene: Scene) -> tuple[int, Floats, npt.NDArray[np.int32]]:
        """Return the body's number, and its corners and facets as `Rigid.facets` does."""
        if not scene.rigid:
            raise ConfigError(f"body {self.body!r} does not exist: the scene has no rigid bodies")
        number = whole("body", self.body, 0, len(scene.rigid) - 1)
        return number, *scene.rigid[number].facets()

    def read(self, simulator: Probed) -> Floats:
        """Return the part, ()."""
        scene, spacing = simulator.scene, simulator.particle_spacing
        number, own, facets = self._facets(scene)
        up, numbers = _up(scene), simulator.rigid_numbers()[number]
        x = placed(own, numbers)
        walls = np.array([scene.walls.lower, scene.walls.upper])
        levels = []
        for axis in range(scene.dim):
            for side, end in ((-1, x.min(axis=0)), (1, x.max(axis=0))):
                place = numbers[: scene.dim].copy()
                place[axis] = end[axis] + side * _BESIDE * spacing
                room = (side * (walls[(side + 1) // 2] - place))[axis]
                if axis != up and room >= _COLUMN / 2 * spacing:
                    levels.append(HeightGauge(np.delete(place, up)).read(simulator))
        if not levels:
            return np.array(np.nan)
        floor_is_low = scene.gravity[up] < 0
        height = x[:, up] - walls[0, up] if floor_is_low else walls[1, up] - x[:, up]
        across = _across(x[facets], up)
        below = _below(across, np.mean(levels) - height[facets])
        return np.array(below / _below(across, height.max() - height[facets]))

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        scene, spacing = simulator.scene, simulator.particle_spacing
        number, own, facets = self._facets(scene)
        up = _up(scene)
        return {
            "kind": "submerged",
            "body": number,
            "corners": own.ravel().tolist(),
            "facets": facets.ravel().tolist(),
            "up": up,
            "floorIsLow": scene.gravity[up] < 0,
            "beside": _BESIDE * spacing,
            "width": _COLUMN * spacing,
            "steps": _STEPS,
            "marks": [],
        }


def _across(corners: Floats, up: int) -> Floats:
    """Return the extents (T,) of facets with corners (T, D, D) as seen along gravity, with a sign."""
    sides = np.delete(corners[:, 1:] - corners[:, :1], up, axis=2)
    return np.asarray(np.linalg.det(sides))


def _below(across: Floats, depth: Floats) -> float:
    """Return the volume of a body below a level up to a factor, by its facets' depths (T, D) at corners [m].

    By Gauss's theorem it is the integral of the depth over the submerged surface as seen along gravity.
    The depth is linear on a facet; a corner alone on its side of the level cuts off a smaller facet there.
    """
    dim = depth.shape[1]
    depth = np.sort(depth, axis=1)
    above = (depth <= 0).sum(axis=1)

    def cut_off(single: Floats, others: Floats) -> Floats:
        parted = dim * np.prod(single + others, axis=1)
        return np.asarray(np.divide(single[:, 0] ** dim, parted, out=np.zeros(len(depth)), where=parted > 0))

    lowest, highest = cut_off(depth[:, -1:], -depth[:, :-1]), cut_off(-depth[:, :1], depth[:, 1:])
    mean = depth.mean(axis=1)
    parts = {0: mean, dim: 0 * mean, dim - 1: lowest}
    return float(
        across @ np.select([above == count for count in parts], list(parts.values()), mean + highest)
    )


@dataclass(frozen=True, eq=False)
class Flow(Probe):
    """Mass that flows through a segment in 2D, or a rectangle across one axis in 3D [kg/s].

    In 2D it is that of a slice one metre deep, and positive to the right of the way from `start` to `end`:
    along +x where that leads upwards. In 3D it is positive along the axis. The momentum in a band of four
    particle spacings is taken, divided by the thickness of the band.
    """

    start: npt.ArrayLike
    """First end of the segment, or a corner of the rectangle, (D,) [m]."""
    end: npt.ArrayLike
    """Other end, or the opposite corner, (D,) [m]."""
    unit: ClassVar[str] = "kg/s"

    def check(self, scene: Scene) -> None:
        """See `Probe.check`."""
        self._frame(scene)

    def _frame(self, scene: Scene) -> tuple[Floats, Floats, Floats]:
        """Return the middle (D,), the axes (D, D), the normal first, and the extents (D - 1,) of the rest."""
        start = checked_points("start", self.start, scene)[0]
        end = checked_points("end", self.end, scene)[0]
        way = end - start
        if scene.dim == 2:
            length = float(np.hypot(*way))
            if length == 0:
                raise ConfigError("end must differ from start")
            along = way / length
            return (start + end) / 2, np.array([[along[1], -along[0]], along]), np.array([length])
        flat = np.flatnonzero(way == 0)
        if len(flat) != 1:
            raise ConfigError(
                "start and end must be equal along one axis of the three, which the flow is counted "
                f"along, and differ along the others; got {self.start!r} and {self.end!r}"
            )
        order = [int(flat[0]), *(axis for axis in range(3) if axis != flat[0])]
        return (start + end) / 2, np.eye(3)[order], np.abs(way)[order[1:]]

    def _band(self, simulator: Probed) -> tuple[Floats, Floats, Floats, Floats]:
        """Return middle (D,), axes (D, D) and the band's corners along the axes, (D,) each."""
        scene, size = simulator.scene, simulator.particle_spacing
        middle, axes, extents = self._frame(scene)
        behind, before = (_reach(middle, side * axes[0], scene, _BAND / 2 * size) for side in (-1, 1))
        return middle, axes, np.array([-behind, *(-extents / 2)]), np.array([before, *(extents / 2)])

    def read(self, simulator: Probed) -> Floats:
        """Return the flow, ()."""
        middle, axes, lower, upper = self._band(simulator)
        part = overlap((simulator.positions - middle) @ axes.T, simulator.particle_spacing, lower, upper)
        speed = simulator.velocities @ axes[0]
        return np.array(float((simulator.mass * part) @ speed) / (upper[0] - lower[0]))

    def plain(self, simulator: Probed) -> dict[str, Any]:
        """See `Probe.plain`."""
        middle, axes, lower, upper = self._band(simulator)
        start, end = (checked_points("end", one, simulator.scene)[0] for one in (self.start, self.end))
        return {
            "kind": "flow",
            "middle": middle.tolist(),
            "axes": axes.tolist(),
            "lower": lower.tolist(),
            "upper": upper.tolist(),
            "marks": [[start.tolist(), end.tolist()]],
        }


def _reach(point: Floats, direction: Floats, scene: Scene, most: float) -> float:
    """Return how far from a point one gets in a direction before a wall, at most `most` [m]."""
    lower, upper = np.array(scene.walls.lower), np.array(scene.walls.upper)
    room = np.where(direction > 0, upper - point, point - lower)
    moving = np.abs(direction) > 1e-9
    return float(min(most, (np.maximum(room, 0.0)[moving] / np.abs(direction)[moving]).min()))


def _up(scene: Scene) -> int:
    """Return the axis of gravity, or raise `ConfigError`."""
    acting = np.flatnonzero(scene.gravity)
    if len(acting) != 1:
        raise ConfigError(f"a height gauge needs gravity along one axis, got {scene.gravity}")
    return int(acting[0])

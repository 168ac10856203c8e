"""`Room`: the space between the walls and outside of the obstacles."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.scene import Scene

_NODES = {2: 64, 3: 24}
"""Nodes along the longest side of the world of the grid for paths around obstacles, by dimension."""

_PUSHES = 4
"""Largest number of times that points are moved out of obstacles; out of one they come at once."""
_PROBE = 1e-3
"""Distance at which the slope of the distance is measured, over the longest side of the world."""


class Room:
    """Walls and obstacles of a scene at one time; moving obstacles have their places of that time.

    Parameters
    ----------
    scene : Scene
    time : float
        [s].
    """

    def __init__(self, scene: Scene, time: float) -> None:
        scene.refuse_rigid("control is", "ways lead around solids whose places are known beforehand")
        self.lower: Floats = np.array(scene.walls.lower)
        """Corner of the walls with the smallest coordinates (D,) [m]."""
        self.upper: Floats = np.array(scene.walls.upper)
        """Corner of the walls with the largest coordinates (D,) [m]."""
        self.unit = max(scene.size)
        """Longest side of the world [m]. Lengths that suit a hand and an eye are parts of it."""
        self.scene = scene
        self._solids = [obstacle.to_native() for obstacle in scene.obstacles]
        self._time = time

    def __reduce__(self) -> tuple[type["Room"], tuple[Scene, float]]:
        """Return what makes the room anew, in copies and pickles: compiled obstacles have neither."""
        return Room, (self.scene, self._time)

    def distance(self, x: Floats) -> Floats:
        """Return the signed distance (N,) [m] of the nearest obstacle from points (N, D)."""
        nearest = np.full(len(x), np.inf)
        if not self._solids:
            return nearest
        points = np.ascontiguousarray(x, dtype=np.float32)
        for solid in self._solids:
            nearest = np.minimum(nearest, solid.signed_distance(points, self._time))
        return nearest

    def within_walls(self, x: Floats) -> npt.NDArray[np.bool_]:
        """Return which points (N, D) lie between the walls, the walls included; (N,)."""
        within = np.ones(len(x), dtype=bool)
        # Axis by axis: numpy reduces rows of two or three slowly.
        for along, lower, upper in zip(x.T, self.lower, self.upper, strict=True):
            within &= (along >= lower) & (along <= upper)
        return within

    def is_free(self, x: Floats) -> npt.NDArray[np.bool_]:
        """Return which points (N, D) lie between the walls and in no obstacle; (N,)."""
        return self.within_walls(x) & (self.distance(x) >= 0)

    def freed(self, x: Floats) -> Floats:
        """Return points (N, D), those in obstacles moved to the nearest surface; between the walls."""
        moved = np.clip(x, self.lower, self.upper)
        for _ in range(_PUSHES if self._solids else 0):
            inside = np.flatnonzero((away := self.distance(moved)) < 0)
            if not len(inside):
                break
            points = moved[inside]
            ends = points[:, None] + _PROBE * self.unit * np.concatenate(
                [np.eye(x.shape[1]), -np.eye(x.shape[1])]
            )
            found = self.distance(ends.reshape(-1, x.shape[1])).reshape(len(points), 2, -1)
            slope = (found[:, 0] - found[:, 1]) / (2 * _PROBE * self.unit)
            step = (_PROBE * self.unit - away[inside])[:, None] * slope
            moved[inside] = np.clip(points + step, self.lower, self.upper)
        return moved

    def lattice(self) -> tuple[Floats, float]:
        """Return the free points (M, D) of a lattice [m], and their distance [m]."""
        side = self.unit / _NODES[len(self.lower)]
        axes = [np.arange(a + side / 2, b, side) for a, b in zip(self.lower, self.upper, strict=True)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        return points[self.is_free(points)], side

    def grid(self) -> "RoomGrid | None":
        """Return the room on a coarse grid, for paths around obstacles; None where there are none."""
        if not self._solids:
            return None
        cells = _NODES[len(self.lower)] / self.unit
        # Whole spacings between the walls, so that the outermost nodes lie on or within them.
        axes = [
            a + np.arange(max(1, int((b - a) * cells + 1e-9)) + 1) / cells
            for a, b in zip(self.lower, self.upper, strict=True)
        ]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        distance = self.distance(nodes.reshape(-1, len(axes))).reshape(nodes.shape[:-1])
        return RoomGrid(self.lower, 1 / cells, distance)


@dataclass(frozen=True, eq=False)
class RoomGrid:
    """Distances of obstacles on a grid between the walls."""

    lower: Floats
    """First node (D,) [m]."""
    spacing: float
    """Distance of the nodes [m]."""
    distance: Floats
    """Signed distance of the nearest obstacle in each node, D axes [m]."""

    def __getstate__(self) -> dict[str, object]:
        """Return the fields alone: what is computed from them is computed anew."""
        return {name: getattr(self, name) for name in ("lower", "spacing", "distance")}

    @cached_property
    def nodes(self) -> Floats:
        """Nodes, D axes and the coordinates [m]."""
        index = np.stack(np.meshgrid(*map(np.arange, self.distance.shape), indexing="ij"), axis=-1)
        return np.asarray(self.lower + self.spacing * index)

    @cached_property
    def space(self) -> _core.FreeSpace:
        """The grid, ready for searches."""
        return _core.FreeSpace(self.lower.tolist(), self.spacing, self.distance)

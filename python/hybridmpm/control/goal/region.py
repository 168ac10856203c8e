"""The region of an oval or of any other shape that the fluid is to fill."""

from dataclasses import dataclass
from typing import Literal, Self, TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageFilter

from hybridmpm import _core
from hybridmpm.control.goal.cloud import Cloud, Floats
from hybridmpm.control.goal.room import Room
from hybridmpm.control.sketch.sketch import Ellipse, Shape, depth_of_width
from hybridmpm.control.sketch.solid import Solid
from hybridmpm.errors import SketchError
from hybridmpm.scene import Walls


@dataclass(frozen=True, eq=False)
class Oval:
    """An ellipse or ellipsoid."""

    center: Floats
    """Centre (D,) [m]."""
    axes: Floats
    """Semi-axes (D,) [m]."""
    directions: Floats
    """Unit vectors along the semi-axes, as rows (D, D)."""

    @classmethod
    def drawn(cls, sketch: Ellipse, cloud: Cloud, walls: Walls) -> Self:
        """Return the oval of a drawn ellipse.

        In 3D the third semi-axis, along the depth, is the geometric mean of the two that are drawn. The width
        of the stroke gives the depth of the centre; without a width it is that of the centre of mass.
        """
        cos, sin = np.cos(sketch.angle), np.sin(sketch.angle)
        directions = np.eye(cloud.dim)
        directions[:2, :2] = [[cos, sin], [-sin, cos]]
        if cloud.dim == 2:
            return cls(np.array(sketch.center), np.array(sketch.axes), directions)
        depth = float(cloud.centroid[2])
        if sketch.width is not None:
            depth = depth_of_width(sketch.width, walls.lower[2], walls.upper[2])
        axes = np.append(sketch.axes, np.sqrt(sketch.axes[0] * sketch.axes[1]))
        return cls(np.append(sketch.center, depth), axes, directions)

    def covers_drawn(self, x: Floats, scale: float = 1.0) -> npt.NDArray[np.bool_]:
        """Return which points (N, D) [m] lie in the ellipse, grown by a factor, of the front view; (N,)."""
        drawn = Oval(self.center[:2], self.axes[:2], self.directions[:2, :2])
        return drawn.covers(x[:, :2], scale)

    @classmethod
    def ball(cls, center: Floats, volume: float) -> Self:
        """Return a disc, or a ball in 3D, of a volume [m^D] around a centre (D,) [m]."""
        dim = len(center)
        unit = np.pi if dim == 2 else 4 / 3 * np.pi
        return cls(np.asarray(center), np.full(dim, (volume / unit) ** (1 / dim)), np.eye(dim))

    @property
    def volume(self) -> float:
        """Volume, in 2D the area [m^D]."""
        return float(np.prod(self.axes) * (np.pi if len(self.axes) == 2 else 4 / 3 * np.pi))

    def sample(self) -> Floats:
        """Return points (K, D) all over the oval [m]."""
        side = np.linspace(-1, 1, 15)
        lattice = np.stack(np.meshgrid(*[side] * len(self.axes)), axis=-1).reshape(-1, len(self.axes))
        within = lattice[np.linalg.norm(lattice, axis=1) <= 1]
        return np.asarray(self.center + within * self.axes @ self.directions)

    def level(self, x: Floats) -> Floats:
        """Return the factors (N,) [-] by which the oval must grow to reach points (N, D)."""
        within = (x - self.center) @ (self.directions.T / self.axes)
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", within, within)))

    def covers(self, x: Floats, scale: float = 1.0) -> npt.NDArray[np.bool_]:
        """Return which points (N, D) [m] lie in the oval grown by a factor; (N,)."""
        return self.level(x) <= scale

    def stretch(self, side: float) -> float:
        """Return the largest difference of the level within a cube of a side [m] from that of its centre."""
        corners = np.stack(np.meshgrid(*[[-side / 2, side / 2]] * len(self.axes)), axis=-1)
        offsets = corners.reshape(-1, len(self.axes)) @ (self.directions.T / self.axes)
        return float(np.linalg.norm(offsets, axis=1).max())


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A shape in 2D; in 3D a body of the same section at all depths of an interval."""

    shape: Shape
    """The shape in the front view."""
    depth: Floats
    """Middle and half length of the interval along the depth (2,) [m] in 3D, (0,) in 2D."""

    @classmethod
    def drawn(cls, shape: Shape, cloud: Cloud, walls: Walls) -> Self:
        """Return the silhouette of a drawn shape.

        In 3D the fluid fills it at the drawn size: the interval is as long as the fluid's volume needs, at
        most from wall to wall. The width of the stroke gives the middle, as that of an oval.
        """
        if cloud.dim == 2:
            return cls(shape, np.empty(0))
        middle, back, front = float(cloud.centroid[2]), walls.lower[2], walls.upper[2]
        if shape.width is not None:
            middle = depth_of_width(shape.width, back, front)
        half = min(_SEAMS * cloud.volume / shape.area, front - back) / 2
        return cls(shape, np.array([np.clip(middle, back + half, front - half), half]))

    @property
    def center(self) -> Floats:
        """Centre of the volume (D,) [m]."""
        return np.append(self.shape.center, self.depth[:1])

    def covers_drawn(self, x: Floats, scale: float = 1.0) -> npt.NDArray[np.bool_]:
        """Return which points (N, D) [m] lie in the shape, grown by a factor, of the front view; (N,)."""
        return Silhouette(self.shape, np.empty(0)).covers(x[:, :2], scale)

    @property
    def volume(self) -> float:
        """Volume, in 2D the area [m^D]."""
        return self.shape.area * (2 * float(self.depth[1]) if len(self.depth) else 1.0)

    def covers(self, x: Floats, scale: float = 1.0) -> npt.NDArray[np.bool_]:
        """Return which points (N, D) [m] lie in the silhouette grown by a factor from its centre; (N,)."""
        at_rest = self.center + (x - self.center) / scale
        inside = self.shape.covers(at_rest[:, :2])
        if len(self.depth):
            inside &= np.abs(at_rest[:, 2] - self.depth[0]) <= self.depth[1]
        return inside

    def box(self, scale: float) -> tuple[Floats, Floats]:
        """Return the corners (D,), (D,) [m] of the box around the silhouette grown by a factor."""
        half = self.depth[1:]
        low, high = (np.append(corner, self.depth[:1]) for corner in self.shape.bounds)
        low[2:], high[2:] = low[2:] - half, high[2:] + half
        return self.center + scale * (low - self.center), self.center + scale * (high - self.center)

    def thin(self, width: float) -> float:
        """Return the share of the area that a square of a width [m] within the shape does not reach [-]."""
        picture, area = self._picture(width)
        opened = picture.filter(ImageFilter.MinFilter(_ACROSS)).filter(ImageFilter.MaxFilter(_ACROSS))
        return 1.0 - float(np.count_nonzero(np.asarray(opened))) / area

    def narrow(self, width: float) -> float:
        """Return the area in gaps that a square of a width [m] does not reach, over that of the shape [-]."""
        picture, area = self._picture(width)
        closed = picture.filter(ImageFilter.MaxFilter(_ACROSS)).filter(ImageFilter.MinFilter(_ACROSS))
        return float(np.count_nonzero(np.asarray(closed))) / area - 1.0

    def _picture(self, width: float) -> tuple[Image.Image, int]:
        """Return the shape in white, with some pixels along a width [m], and its area in pixels."""
        pixel = width / _ACROSS
        low, high = self.shape.bounds
        # A margin beyond which neither filter reaches.
        columns, rows = (np.ceil((high - low) / pixel).astype(int) + 2 * _ACROSS).tolist()
        x, y = np.meshgrid(np.arange(columns) + 0.5 - _ACROSS, np.arange(rows) + 0.5 - _ACROSS)
        inside = self.shape.covers(low + pixel * np.column_stack([x.ravel(), y.ravel()]))
        picture = Image.fromarray((255 * inside.reshape(rows, columns)).astype(np.uint8))
        return picture, max(1, int(inside.sum()))

    def sample(self) -> Floats:
        """Return points (K, D) all over the silhouette [m]."""
        low, high = self.box(1.0)
        side = (np.arange(_ALONG) + 0.5) / _ALONG
        lattice = np.stack(np.meshgrid(*[side] * len(low)), axis=-1).reshape(-1, len(low))
        points = low + lattice * (high - low)
        return points[self.covers(points)]


Figure: TypeAlias = Oval | Silhouette | Solid
"""What a sketch encloses."""

Fill = Literal["even", "shrink"]
"""Filling of a goal larger than the fluid: evenly, or after it is shrunk to the fluid's volume."""

NEAR = 0.01
"""Largest distance of the centre of mass from the drawn end at which that is reached, over the longest side
of the world."""
FULL = 0.95
"""Least share of the mass inside of a region at which that counts as filled [-]."""
_CENTRED = 0.7 * NEAR
"""Distance of a region's middle from the tip at which its fluid arrives there, likewise."""
_SHIFTS = 40
"""Number of shifts of a disc whose middle walls and obstacles have moved."""
_SEAMS = _core.SEAMS_IN_3D
"""Volume of a shape in 3D over that of the fluid that fills it [-]."""
_ROOM = 1.03
"""Volume of settled fluid over its volume at rest [-]."""
_CELLS_PER_PARTICLE = {2: 6, 3: 6}
"""Cells of the raster for each particle, by dimension; places are centres of groups of cells."""
_BLOCKS = 4096
"""Largest number of blocks at the start of the search for cells."""
_ALONG = 40
"""Points along each axis of the box around a shape, of which those inside sample it."""
_ACROSS = 7
"""Pixels across the width against which a shape is held; an odd number."""
_CAUTION = 1.0 + 1e-4
"""Factor on the radius of blocks, since distances from obstacles are rounded to single precision."""


@dataclass(frozen=True, eq=False)
class Region:
    """The part of a figure that is filled, at its final size, between walls and obstacles."""

    figure: Figure
    """What was drawn."""
    room: Room
    scale: float
    """Factor on the size: above 1 where the figure was grown to the fluid's volume."""
    cells: Floats
    """Centres (M, D) of equal cells that make up the region [m]."""
    volume: float
    """Volume of the cells, in 2D their area [m^D]."""

    @property
    def side(self) -> float:
        """Side of a cell [m]."""
        return float((self.volume / len(self.cells)) ** (1 / self.cells.shape[1]))

    def reaches(self, x: Floats, scale: float) -> npt.NDArray[np.bool_]:
        """Return which points (N, D) lie in the free part of the figure grown by a factor; (N,)."""
        return self.room.is_free(x) & self.figure.covers(x, scale)


def region_of(
    figure: Figure, room: Room, *, volume: float, particles: int, fill: Fill, name: str = "the goal"
) -> Region:
    """Return the region of a figure that a fluid is to fill.

    Where the free part of the figure is smaller than the fluid, the figure grows in the same shape, with its
    holes, until its free part is as large. Where it is larger, `fill` decides.

    Parameters
    ----------
    figure : Oval, Silhouette or Solid
    room : Room
        Walls and obstacles.
    volume : float
        Volume of the fluid at rest [m^D].
    particles : int
        Number of particles.
    fill : "even" or "shrink"
    name : str
        Name of the figure in the message.

    Raises
    ------
    SketchError
        No part of the figure is free.
    """
    if not room.is_free(figure.sample()).any():
        raise SketchError(
            f"no part of {name} is free: it lies in obstacles or outside of the walls; draw the goal where "
            "the fluid can be"
        )
    return _filled(figure, room, volume=volume, particles=particles, fill=fill)


def _filled(figure: Figure, room: Room, *, volume: float, particles: int, fill: Fill) -> Region:
    """Return the region of a figure of which a part is free."""
    dim = len(figure.center)
    if isinstance(figure, Silhouette):
        cells, side, scale = figure.shape.compiled.filled(
            room.lower.tolist(),
            room.upper.tolist(),
            volume=volume,
            particles=particles,
            shrinks=fill == "shrink",
            free=lambda cells: room.distance(cells) >= 0,
            depth=figure.depth.tolist() or None,
        )
        return Region(figure, room, scale, cells, len(cells) * side**dim)
    if isinstance(figure, Solid):
        low, high = figure.bounds
        cells, side, scale = _core.filled_solid(
            room.lower.tolist(),
            room.upper.tolist(),
            center=figure.center.tolist(),
            low=low.tolist(),
            high=high.tolist(),
            solid=figure.volume,
            volume=volume,
            particles=particles,
            shrinks=fill == "shrink",
            covers=figure.covers_cells,
            free=lambda cells: room.distance(cells) >= 0,
        )
        return Region(figure, room, scale, cells, len(cells) * side**dim)
    volume *= _ROOM
    wanted = max(volume, figure.volume if fill == "even" else 0.0)
    side = (wanted / (_CELLS_PER_PARTICLE[dim] * particles)) ** (1 / dim)
    needed = max(1, round(volume / side**dim))
    return _filled_oval(figure, room, side, needed, fill)


def _filled_oval(oval: Oval, room: Room, side: float, needed: int, fill: Fill) -> Region:
    """Return the region of an oval: it grows from cell to cell until they are enough."""
    cells, level = _nearest_cells(oval, room, side, needed, 1.0 if fill == "even" else 0.0)
    needed = min(len(level), needed)
    fitting = float(np.partition(level, needed - 1)[needed - 1])
    scale = fitting if fill == "shrink" else max(1.0, fitting)
    kept = cells[level <= scale]
    return Region(oval, room, scale, kept, len(kept) * side ** len(oval.center))


def gathered(tip: Floats, room: Room, *, volume: float, particles: int) -> Region:
    """Return the free part of a disc, or ball, in which a fluid has room around a tip (D,) [m].

    Where walls and obstacles take a part of a disc around the tip, the middle of the rest is off the tip.
    The disc is then shifted towards them until the middle is at the tip. That is the most compact region
    with this middle. Where there is none, the disc stays around the tip.

    Parameters are otherwise those of `region_of`.
    """
    start = np.clip(tip, room.lower, room.upper)
    around, name = Oval.ball(start, volume), "the place for the fluid around the tip"
    region = region_of(around, room, volume=volume, particles=particles, fill="shrink", name=name)
    if (
        np.linalg.norm(region.cells.mean(axis=0) - tip) <= NEAR * room.unit
        or not room.is_free(tip[None]).all()
    ):
        return region
    nodes, side = room.lattice()
    count = min(len(nodes), max(1, round(_ROOM * volume / side ** len(tip))))
    center = start
    found = []
    for _ in range(_SHIFTS):
        away = np.linalg.norm(nodes - center, axis=1)
        near = np.argpartition(away, count - 1)[:count]
        off = tip - nodes[near].mean(axis=0)
        found.append((float(np.linalg.norm(off)), center, float(away[near].max())))
        center = center + 2 * off
    _, center, radius = min(found, key=lambda one: one[0])
    disc = Oval(center, np.full(len(tip), radius), np.eye(len(tip)))
    shifted = _filled(disc, room, volume=volume, particles=particles, fill="shrink")
    return shifted if np.linalg.norm(shifted.cells.mean(axis=0) - tip) <= _CENTRED * room.unit else region


def _nearest_cells(
    oval: Oval, room: Room, side: float, needed: int, least: float
) -> tuple[Floats, npt.NDArray[np.float64]]:
    """Return the free cells that a growing oval reaches until they are enough.

    The room is cut into blocks, and what may hold one of the nearest cells is halved along each axis until
    the blocks are cells. So the work depends on the cells that are needed, not on the size of the room, nor
    on how thin the oval is or how much of it obstacles take.

    Parameters
    ----------
    oval : Oval
    room : Room
    side : float
        Side of a cell [m]; the lattice of cells begins in the lower corner of the walls.
    needed : int
        Number of cells, all of which are returned where the room holds fewer.
    least : float
        Factor on the oval whose cells are returned in any case.

    Returns
    -------
    cells, level : float64 (M, D), (M,)
        Centres [m], and the factors on the oval that reach them; some more than those that are needed.
    """
    dim = len(oval.center)
    along = np.maximum(1, np.round((room.upper - room.lower) / side)).astype(np.int64)
    size = 1
    while np.prod(-(-along // size)) > _BLOCKS:
        size *= 2
    halves = np.stack(np.meshgrid(*[[0, 1]] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    index = np.stack(np.meshgrid(*(np.arange(-(-n // size)) for n in along), indexing="ij"), axis=-1)
    index = index.reshape(-1, dim)
    while size > 1:
        center = room.lower + size * side * (index + 0.5)
        distance, radius = room.distance(center), _CAUTION * size * side * np.sqrt(dim) / 2
        level, slack = oval.level(center), oval.stretch(size * side)
        whole = (distance >= radius) & (center + size * side / 2 <= room.upper).all(axis=1)
        enough = -(-needed // size**dim)
        reach = np.inf
        if np.count_nonzero(whole) >= enough:
            reach = max(least, float(np.partition(level[whole] + slack, enough - 1)[enough - 1]))
        size //= 2
        kept = 2 * index[(distance >= -radius) & (level - slack <= reach)]
        index = (kept[:, None] + halves).reshape(-1, dim)
        index = index[(size * index < along).all(axis=1)]
    cells = room.lower + side * (index + 0.5)
    cells = cells[room.is_free(cells)]
    return cells, oval.level(cells)

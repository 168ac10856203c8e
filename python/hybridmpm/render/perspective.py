"""Pictures of 3D scenes: particles are shaded spheres in perspective, above a floor with their shadow."""

import math

import numpy as np
import numpy.typing as npt

from hybridmpm._core import Obstacle, RigidBody
from hybridmpm.render import palette
from hybridmpm.render.palette import Colors
from hybridmpm.scene import Scene

_SUPERSAMPLING = 2
_YAW, _PITCH = math.radians(32.0), math.radians(20.0)
_DISTANCE = 2.6
"""Distance of the eye from the centre of the walls, in units of the walls' diagonal over sqrt(3)."""
_FIELD_OF_VIEW = math.radians(35.0)
_LIGHT = np.array([-0.45, 0.80, 0.40], dtype=np.float32) / np.float32(math.sqrt(1.0025))
"""Unit vector towards the light in view coordinates: right, up, to the viewer."""
_SHADOW_CELLS = 96
"""Number of cells of the floor's shadow along each side."""
_AT_ONCE = 20_000
"""Number of spheres painted at once, which bounds the memory."""
_EDGE_RADIUS = 0.0016
"""Radius of the spheres along the edges of the walls [m]."""

Field = npt.NDArray[np.float32]


class PerspectiveView:
    """Draws states of one 3D scene. Parameters are those of `FlatView`; the height is 3/4 of the width."""

    def __init__(self, scene: Scene, types: npt.NDArray[np.uint8], width: int, spacing: float) -> None:
        self._lower, self._upper = np.array(scene.walls.lower), np.array(scene.walls.upper)
        self._width = _SUPERSAMPLING * (width + width % 2)
        self._height = _SUPERSAMPLING * 2 * math.ceil(3 * width / 8)
        self._axes = _view_axes()
        span = float(np.linalg.norm(self._upper - self._lower)) / math.sqrt(3.0)
        # The eye looks below the centre of the walls, because fluids rest on the floor.
        self._target = (self._lower + self._upper) / 2 - np.array([0.0, 0.08 * span, 0.0])
        self._eye_distance = _DISTANCE * span
        self._focal = 0.5 * self._height / math.tan(_FIELD_OF_VIEW / 2)
        self._radius = 0.62 * spacing
        self._kinds = types
        still = [obstacle.to_native() for obstacle in scene.obstacles if obstacle.motion is None]
        moving = [obstacle.to_native() for obstacle in scene.obstacles if obstacle.motion is not None]
        lattice = self._lattice(scene.spacing)
        self._shell_radius = 0.8 * scene.spacing
        self._moving = [(solid, _shell(solid, lattice, scene.spacing)) for solid in moving]
        self._scene = scene
        self._rigid = [_shell(body.to_native(), lattice, scene.spacing) for body in scene.rigid]
        self._still_shells = [_shell(solid, lattice, scene.spacing) for solid in still]
        self._edges = _box_edges(self._lower, self._upper).astype(np.float32)
        self._background, self._floor = self._draw_background()

    def draw(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        time: float = 0.0,
        rigid: npt.NDArray[np.float64] | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Draw particles at `x` (N, 3) [m] with velocities `v` (N, 3) [m/s]; see `View.draw`."""
        there = np.isfinite(x[:, 0])
        x, v, types = x[there], v[there], self._kinds[there]
        speed = np.linalg.norm(v, axis=1)
        color = np.empty((len(x), 3), dtype=np.float32)
        for kind in np.unique(types):
            members = types == kind
            color[members] = palette.by_speed(int(kind), speed[members])
        image = self._background * self._shade_of(x)[..., None]
        shells = np.concatenate([x[:0], *self._still_shells, *self._moved_shells(time)])
        bodies = np.concatenate([x[:0], *self._body_shells(rigid)])
        kinds = (
            (x, self._radius, color),
            (self._edges, _EDGE_RADIUS, np.tile(palette.WALL, (len(self._edges), 1))),
            (shells, self._shell_radius, np.tile(palette.OBSTACLE, (len(shells), 1))),
            (bodies, self._shell_radius, np.tile(palette.RIGID, (len(bodies), 1))),
        )
        image = self._draw_spheres(
            image.reshape(-1, 3),
            np.concatenate([centers for centers, _, _ in kinds]),
            np.concatenate([np.full(len(centers), radius, np.float32) for centers, radius, _ in kinds]),
            np.concatenate([colors for _, _, colors in kinds]),
        )
        full = image.reshape(self._height, self._width, 3)
        return palette.to_bytes(palette.shrink(full, _SUPERSAMPLING))

    def _draw_spheres(self, image: Colors, x: Field, radius: Field, color: Colors) -> Colors:
        """Paint spheres from far to near, so that near ones cover far ones."""
        view = self._to_view(x)
        for some in np.array_split(np.argsort(-view[:, 2]), len(x) // _AT_ONCE + 1):
            self._paint(image, view[some], radius[some], color[some])
        return image

    def _paint(self, image: Colors, view: Field, radius: Field, color: Colors) -> None:
        per_metre = self._focal / view[:, 2]
        column = view[:, 0] * per_metre + self._width / 2
        row = self._height / 2 - view[:, 1] * per_metre
        reach = np.maximum(radius * per_metre, 0.7)
        steps = np.arange(-math.ceil(float(reach.max())), math.ceil(float(reach.max())) + 1)
        down, right = (offset.ravel() for offset in np.meshgrid(steps, steps, indexing="ij"))
        i = np.floor(row).astype(np.int64)[:, None] + down
        j = np.floor(column).astype(np.int64)[:, None] + right
        normal_x = (j + 0.5 - column[:, None]) / reach[:, None]
        normal_y = (row[:, None] - i - 0.5) / reach[:, None]
        flat = normal_x**2 + normal_y**2
        seen = (flat < 1.0) & (i >= 0) & (i < self._height) & (j >= 0) & (j < self._width)
        normal_z = np.sqrt(np.maximum(1.0 - flat, 0.0))
        facing = (_LIGHT[0] * normal_x + _LIGHT[1] * normal_y + _LIGHT[2] * normal_z)[seen]
        owner = np.nonzero(seen)[0]
        # Far spheres fade a little into the colour of the sky.
        haze = np.clip((view[:, 2] / self._eye_distance - 0.75) * 0.5, 0.0, 0.45)
        lit = color[owner] * (0.50 + 0.50 * np.clip(facing, 0.0, 1.0))[:, None]
        lit = lit + (0.35 * np.clip(facing, 0.0, 1.0) ** 12)[:, None]
        lit = palette.mix(lit.astype(np.float32), palette.SKY_BOTTOM, haze[owner])
        image[i[seen] * self._width + j[seen]] = lit

    def _to_view(self, x: npt.NDArray[np.floating]) -> Field:
        """Return points (N, 3) in view coordinates: right, up, and depth from the eye [m]."""
        view = (x - self._target) @ self._axes.T
        view[:, 2] = self._eye_distance - view[:, 2]
        return np.asarray(view, dtype=np.float32)

    def _lattice(self, step: float) -> Field:
        """Return points (N, 3) that fill the box between the walls, `step` apart [m]."""
        axes = [np.arange(a + step / 2, b, step) for a, b in zip(self._lower, self._upper, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)

    def _moved_shells(self, time: float) -> list[Field]:
        """Return the surface points of each moving obstacle at a time [s] that lie between the walls."""
        moved = [solid.moved(shell, time) for solid, shell in self._moving]
        return [x[((x >= self._lower) & (x <= self._upper)).all(axis=1)] for x in moved]

    def _body_shells(self, rigid: npt.NDArray[np.float64] | None) -> list[Field]:
        """Return the surface points of each rigid body with its numbers."""
        if rigid is None:
            return []
        pairs = zip(self._scene.rigid, self._rigid, rigid, strict=True)
        return [
            body.moved(shell.astype(np.float64), numbers).astype(np.float32) for body, shell, numbers in pairs
        ]

    def _draw_background(self) -> tuple[Colors, npt.NDArray[np.int64]]:
        """Return the picture of sky and floor, and the shadow cell of each pixel, -1 beside the floor."""
        i, j = np.mgrid[0 : self._height, 0 : self._width]
        fall = i / self._height
        image = palette.mix(
            np.broadcast_to(palette.SKY_TOP, (*i.shape, 3)),
            np.broadcast_to(palette.SKY_BOTTOM, (*i.shape, 3)),
            fall,
        )
        ray = (
            ((j + 0.5 - self._width / 2) / self._focal)[..., None] * self._axes[0]
            + ((self._height / 2 - i - 0.5) / self._focal)[..., None] * self._axes[1]
            - self._axes[2]
        )
        eye = self._target + self._eye_distance * self._axes[2]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (self._lower[1] - eye[1]) / ray[..., 1]
            hit = eye + reach[..., None] * ray
            place = (hit - self._lower) / (self._upper - self._lower)
            on_floor = (reach > 0) & ((place >= 0) & (place < 1))[..., [0, 2]].all(axis=-1)
        cell = np.full(i.shape, -1, dtype=np.int64)
        inside = place[on_floor]
        where = (inside[:, [0, 2]] * _SHADOW_CELLS).astype(np.int64)
        cell[on_floor] = where[:, 0] * _SHADOW_CELLS + where[:, 1]
        tiles = np.floor(inside[:, 0] * 8) + np.floor(inside[:, 2] * 8)
        image[on_floor] = palette.SKY_BOTTOM * (1.45 + 0.25 * (tiles % 2))[:, None].astype(np.float32)
        return image.astype(np.float32), cell

    def _shade_of(self, x: npt.NDArray[np.float32]) -> Field:
        """Return the brightness (H, W) of the floor in the shadow of particles at `x` (N, 3) [m]."""
        place = (x - self._lower)[:, [0, 2]] / (self._upper - self._lower)[[0, 2]]
        cell = np.clip((place * _SHADOW_CELLS).astype(np.int64), 0, _SHADOW_CELLS - 1)
        count = np.bincount(cell[:, 0] * _SHADOW_CELLS + cell[:, 1], minlength=_SHADOW_CELLS**2)
        area = np.prod((self._upper - self._lower)[[0, 2]]) / _SHADOW_CELLS**2
        cover = (count * (2 * self._radius) ** 2 / area).reshape(_SHADOW_CELLS, _SHADOW_CELLS)
        for _ in range(3):
            for axis in (0, 1):
                cover = (np.roll(cover, 1, axis) + 2 * cover + np.roll(cover, -1, axis)) / 4
        light = np.append(1.0 - 0.6 * np.clip(cover, 0.0, 1.0), 1.0).astype(np.float32)
        return np.asarray(light[self._floor])


def _shell(solid: Obstacle | RigidBody, lattice: Field, step: float) -> Field:
    """Return the points of a lattice just under the surface of a solid at time 0."""
    distance = solid.signed_distance(lattice)
    return lattice[(distance <= 0) & (distance > -1.5 * step)]


def _view_axes() -> npt.NDArray[np.float64]:
    """Return three unit vectors (3, 3) in world coordinates: right, up and towards the viewer."""
    toward = np.array(
        [math.cos(_PITCH) * math.sin(_YAW), math.sin(_PITCH), math.cos(_PITCH) * math.cos(_YAW)]
    )
    right = np.cross([0.0, 1.0, 0.0], toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])


def _box_edges(lower: npt.NDArray[np.float64], upper: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return points (K, 3) along the twelve edges of a box."""
    along = np.linspace(0.0, 1.0, 400)
    edges = []
    for axis in range(3):
        for corner in range(4):
            place = np.empty((len(along), 3))
            place[:, axis] = along
            place[:, (axis + 1) % 3] = corner % 2
            place[:, (axis + 2) % 3] = corner // 2
            edges.append(lower + place * (upper - lower))
    return np.concatenate(edges)

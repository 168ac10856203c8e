"""Pictures of 2D scenes: each material is a smooth surface, drawn from the density of its particles."""

import numpy as np
import numpy.typing as npt

from hybridmpm._core import Obstacle
from hybridmpm.render import palette
from hybridmpm.render.palette import Colors
from hybridmpm.scene import Scene

MARGIN = 0.03
"""Margin around the walls, as a fraction of their longer side."""
_SUPERSAMPLING = 3
"""Number of samples of the background along each side of a pixel."""
_EDGE = 2.0
"""Width of the lines around walls and obstacles [pixels]."""
Field = npt.NDArray[np.float32]
_OBSTACLE = (palette.OBSTACLE, palette.OBSTACLE_EDGE)
_RIGID = (palette.RIGID, palette.RIGID_EDGE)


class FlatView:
    """Draws states of one 2D scene.

    Parameters
    ----------
    scene : Scene
    types : uint8 (N,)
        DeepMind's particle types.
    width : int
        Width of the pictures [pixels]; the height follows from the walls. Both are rounded up to even
        numbers, because video encoders need them.
    spacing : float
        Distance of the particles at rest [m].
    """

    def __init__(self, scene: Scene, types: npt.NDArray[np.uint8], width: int, spacing: float) -> None:
        lower, upper = np.array(scene.walls.lower), np.array(scene.walls.upper)
        margin = MARGIN * float((upper - lower).max())
        size = upper - lower + 2 * margin
        self._scene = scene
        self._spacing = spacing
        self._width = width + width % 2
        self._scale = self._width / float(size[0])
        self._height = 2 * int(np.ceil(self._scale * float(size[1]) / 2))
        self._origin = lower - margin
        self._groups = {int(kind): np.flatnonzero(types == kind) for kind in np.unique(types)}
        # The brightness of each grain is drawn once, so that grains do not flicker.
        self._grain = np.random.default_rng(0).uniform(-1.0, 1.0, len(types)).astype(np.float32)
        still = [obstacle for obstacle in scene.obstacles if obstacle.motion is None]
        self._moving = [obstacle.to_native() for obstacle in scene.obstacles if obstacle.motion is not None]
        self._rigid = [body.to_native() for body in scene.rigid]
        self._background, self._solid = self._draw_background([solid.to_native() for solid in still])

    def draw(
        self,
        x: npt.NDArray[np.float32],
        v: npt.NDArray[np.float32],
        time: float = 0.0,
        rigid: npt.NDArray[np.float64] | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Draw particles at `x` (N, 2) [m] with velocities `v` (N, 2) [m/s]; see `View.draw`."""
        image = self._background
        speed = np.linalg.norm(v, axis=1)
        there = np.isfinite(x[:, 0])
        for kind, everybody in self._groups.items():
            members = everybody[there[everybody]]
            image = self._draw_material(image, kind, x[members], speed[members], self._grain[members])
        for solid in self._moving:
            image = self._draw_solid(image, solid.signed_distance(self._centers(), time), _OBSTACLE)
        if rigid is not None:
            for body, native, numbers in zip(self._scene.rigid, self._rigid, rigid, strict=True):
                own = body.at_start(self._centers().astype(np.float64), numbers).astype(np.float32)
                image = self._draw_solid(image, native.signed_distance(own), _RIGID)
        return palette.to_bytes(palette.mix(image, self._background, self._solid))

    def _centers(self) -> Field:
        """Return the centres (H * W, 2) of the pixels [m]."""
        columns, rows = np.arange(self._width) + 0.5, np.arange(self._height)[::-1] + 0.5
        x = self._origin + np.stack(np.meshgrid(columns, rows), axis=-1) / self._scale
        return x.reshape(-1, 2).astype(np.float32)

    def _draw_solid(self, image: Colors, distance: Field, colors: tuple[Field, Field]) -> Colors:
        """Draw a solid; its distance from a pixel's centre gives how far it covers the pixel."""
        depth = -distance.reshape(self._height, self._width) * self._scale
        body, edge = (np.broadcast_to(color, image.shape) for color in colors)
        surface = palette.mix(edge, body, np.clip(depth - _EDGE + 0.5, 0.0, 1.0))
        return palette.mix(image, surface, np.clip(depth + 0.5, 0.0, 1.0))

    def _draw_material(self, image: Colors, kind: int, x: Field, speed: Field, grain: Field) -> Colors:
        pitch = self._spacing * self._scale
        full = 1.0 / pitch**2
        place = self._pixels(x)
        density = _blur(self._deposit(place, np.ones(len(x), np.float32)), 0.7 * pitch) / full
        mean_speed = _blur(self._deposit(place, speed), 0.7 * pitch) / full / np.maximum(density, 1e-3)
        color = palette.by_speed(kind, mean_speed)
        if kind == 6:
            spots = _blur(self._deposit(place, grain), 0.4 * pitch) / full
            color = color * (1.0 + 0.22 * np.clip(spots, -1.5, 1.5)[..., None])
        else:
            # The surface gets a bright rim. It is looked for in means over a cell of the grid: smaller gaps
            # between particles mean nothing to the solver.
            rim = 1.0 - palette.smoothstep(0.35, 0.85, _blur(density, pitch))
            color = palette.mix(color, color * 0.45 + 0.55, 0.55 * rim)
        return palette.mix(image, color, palette.smoothstep(0.16, 0.34, density))

    def _pixels(self, x: Field) -> Field:
        """Return column and row (N, 2) of points; pixel centres are whole numbers, rows count downwards."""
        place = (x - self._origin) * self._scale - 0.5
        place[:, 1] = self._height - 1 - place[:, 1]
        return place.astype(np.float32)

    def _deposit(self, place: Field, values: Field) -> Field:
        """Spread each value over the four pixels around its place, as far as these are in the picture."""
        corner = np.floor(place).astype(np.int64)
        offset = place - corner
        total = np.zeros(self._height * self._width)
        for right in (0, 1):
            for down in (0, 1):
                column, row = corner[:, 0] + right, corner[:, 1] + down
                weight = np.abs(1 - right - offset[:, 0]) * np.abs(1 - down - offset[:, 1])
                seen = (column >= 0) & (column < self._width) & (row >= 0) & (row < self._height)
                flat = row[seen] * self._width + column[seen]
                total += np.bincount(flat, (weight * values)[seen], len(total))
        return total.reshape(self._height, self._width).astype(np.float32)

    def _draw_background(self, solids: list[Obstacle]) -> tuple[Colors, Field]:
        """Return the picture of sky, walls and obstacles at rest, and how far (H, W) solids cover it."""
        fine = self._scale * _SUPERSAMPLING
        columns = (np.arange(self._width * _SUPERSAMPLING) + 0.5) / fine
        rows = (np.arange(self._height * _SUPERSAMPLING)[::-1] + 0.5) / fine
        x = self._origin + np.stack(np.meshgrid(columns, rows), axis=-1)
        shape = x.shape[:2]
        points = x.reshape(-1, 2).astype(np.float32)

        lower, upper = np.array(self._scene.walls.lower), np.array(self._scene.walls.upper)
        height = np.clip((x[..., 1] - lower[1]) / (upper[1] - lower[1]), 0.0, 1.0)
        image = palette.mix(
            np.broadcast_to(palette.SKY_BOTTOM, (*shape, 3)),
            np.broadcast_to(palette.SKY_TOP, (*shape, 3)),
            height,
        )
        outside = np.maximum(lower - x, x - upper).max(axis=-1)
        line = _EDGE / self._scale
        image = np.where((outside > 0)[..., None], palette.OUTSIDE, image)
        wall = (outside > 0) & (outside < line)
        image = np.where(wall[..., None], palette.WALL, image)
        solid = outside > 0
        for obstacle in solids:
            depth = -obstacle.signed_distance(points).reshape(shape)
            body = np.where((depth < line)[..., None], palette.OBSTACLE_EDGE, palette.OBSTACLE)
            inside = (depth > 0) & (outside <= 0)
            image = np.where(inside[..., None], body, image)
            solid = solid | inside
        coverage = palette.shrink(solid[..., None].astype(np.float32), _SUPERSAMPLING)[..., 0]
        return palette.shrink(image.astype(np.float32), _SUPERSAMPLING), coverage


def _blur(field: Field, sigma: float) -> Field:
    """Convolve a field (H, W) with a Gaussian of `sigma` pixels."""
    reach = max(1, int(np.ceil(3.0 * sigma)))
    taps = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sigma, 0.3)) ** 2).astype(np.float32)
    taps /= taps.sum()
    for axis in (0, 1):
        field = _convolve(field, taps, axis)
    return field


def _convolve(field: Field, taps: Field, axis: int) -> Field:
    reach = len(taps) // 2
    length = field.shape[axis]
    padded = np.pad(field, [(reach, reach) if axis == a else (0, 0) for a in (0, 1)])
    total = np.zeros_like(field)
    for offset, tap in enumerate(taps):
        total += tap * np.take(padded, range(offset, offset + length), axis=axis)
    return total

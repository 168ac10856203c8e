"""Sketches laid on pictures of the room that they were drawn in."""

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm.render import palette
from hybridmpm.render.flat import MARGIN
from hybridmpm.scene import Scene, Walls

Picture = npt.NDArray[np.uint8]
_GHOST = 0.85
"""Opacity of a sketch."""
_INSET = 0.22
"""Width of the front view within a picture of a 3D scene."""


def with_ink(picture: Picture, raster: Picture, scene: Scene, strength: float = 1.0) -> Picture:
    """Lay the ink of a sketch on a picture.

    Parameters
    ----------
    picture : uint8 (H, W, 3)
        Front view of the room between the walls and of the margin around them, as `FlatView` draws it.
    raster : uint8 (R, R, 3 or 4)
        The front of the world as `control.render` draws it, with ink of one colour on white.
    scene : Scene
    strength : float in [0, 1]
        How much of what lies below the ink is hidden.
    """
    walls, longest = scene.walls, max(scene.size)
    lower, upper = np.array(walls.lower[:2]), np.array(walls.upper[:2])
    margin = MARGIN * float((upper - lower).max())
    # Places in the square that the raster shows, and in one that is wider by a half on each side: walls may
    # lie on the edge of the world.
    beside = (longest - np.array(scene.size[:2])) / 2
    (left, bottom), (right, top) = (lower - margin + beside) / longest, (upper + margin + beside) / longest
    side = len(raster)
    wide = np.pad(raster[..., :3], ((side // 2,) * 2, (side // 2,) * 2, (0, 0)), constant_values=255)
    box = tuple(side * place + side // 2 for place in (left, 1 - top, right, 1 - bottom))
    size = picture.shape[1], picture.shape[0]
    ink = np.asarray(Image.fromarray(wide).resize(size, Image.Resampling.LANCZOS, box))
    # The ground is white and the ink of one colour: the missing white of a pixel is its share of ink.
    lack = 255.0 - ink
    cover = strength * lack.max(axis=2, keepdims=True) / max(1.0, float(lack.max()))
    colour = 255 - lack.reshape(-1, 3).max(axis=0)
    mixed: npt.NDArray[np.float64] = picture + cover * (colour - picture)
    return np.clip(mixed, 0, 255).astype(np.uint8)


def with_sketch(picture: Picture, raster: Picture, scene: Scene) -> Picture:
    """Lay a sketch, as `control.render` draws it, on a picture; in 3D on a small front view in its corner."""
    if scene.dim == 2:
        return with_ink(picture, raster, scene, _GHOST)
    inset = empty_front(scene.walls, round(_INSET * picture.shape[1]))
    picture = picture.copy()
    picture[: inset.shape[0], -inset.shape[1] :] = with_ink(inset, raster, scene)
    return picture


def empty_front(walls: Walls, width: int) -> Picture:
    """Draw the walls of a 3D scene as sketches see them, from the front, `width` pixels wide."""
    lower, upper = np.array(walls.lower[:2]), np.array(walls.upper[:2])
    margin = MARGIN * float((upper - lower).max())
    scale = width / float(upper[0] - lower[0] + 2 * margin)
    room = scale * (upper - lower)
    inset = scale * margin
    height = round(float(room[1]) + 2 * inset)
    picture = Image.new("RGB", (width, height), _rgb(palette.OUTSIDE))
    box = (inset, inset, inset + float(room[0]), inset + float(room[1]))
    ImageDraw.Draw(picture).rectangle(box, _rgb(palette.SKY_TOP), _rgb(palette.WALL), 2)
    return np.asarray(picture)


def _rgb(color: palette.Colors) -> tuple[int, int, int]:
    red, green, blue = (int(value) for value in palette.to_bytes(color))
    return red, green, blue

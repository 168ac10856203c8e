"""Sketches laid on pictures of the room that they were drawn in."""

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from hybridmpm.render import palette
from hybridmpm.render.flat import MARGIN
from hybridmpm.scene import Walls

Picture = npt.NDArray[np.uint8]


def with_ink(picture: Picture, raster: Picture, walls: Walls, strength: float = 1.0) -> Picture:
    """Lay the ink of a sketch on a picture.

    Parameters
    ----------
    picture : uint8 (H, W, 3)
        Front view of the room between the walls and of the margin around them, as `FlatView` draws it.
    raster : uint8 (R, R, 3 or 4)
        The whole world, [0, 1] along both axes, with ink of one colour on white.
    walls : Walls
    strength : float in [0, 1]
        How much of what lies below the ink is hidden.
    """
    lower, upper = np.array(walls.lower[:2]), np.array(walls.upper[:2])
    margin = MARGIN * float((upper - lower).max())
    (left, bottom), (right, top) = lower - margin, upper + margin
    rows, columns = raster.shape[:2]
    box = (left * columns, (1 - top) * rows, right * columns, (1 - bottom) * rows)
    size = picture.shape[1], picture.shape[0]
    ink = np.asarray(Image.fromarray(raster[..., :3]).resize(size, Image.Resampling.LANCZOS, box))
    # The ground is white and the ink of one colour: the missing white of a pixel is its share of ink.
    lack = 255.0 - ink
    cover = strength * lack.max(axis=2, keepdims=True) / max(1.0, float(lack.max()))
    colour = 255 - lack.reshape(-1, 3).max(axis=0)
    mixed: npt.NDArray[np.float64] = picture + cover * (colour - picture)
    return np.clip(mixed, 0, 255).astype(np.uint8)


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

"""The drawn pixels of a raster: which of them are connected, and how far apart they are along a stroke.

A mask is bool (512, 512) with row 0 on top. Points are (x, y) in pixels; the middle of pixel (row, column) is
(column + 0.5, row + 0.5).
"""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.errors import SketchError

Mask: TypeAlias = npt.NDArray[np.bool_]
Levels: TypeAlias = npt.NDArray[np.int32]

MIN_INK = 40
"""Smallest number of drawn pixels in a sketch, those of a stroke of 2 x 20 pixels."""
MAX_INK = 0.3
"""Largest fraction of the picture that may be ink; a photograph or a filled shape has more."""
MIN_COLOR = 32
"""Weakest colour that counts as ink, on a scale of 0 to 255."""
_MAIN_INK = 0.8
"""Smallest fraction of the ink that the main mark must have; smaller marks are dust."""
_WINDOW = 16
"""Largest half width that is measured [pixels]; that of the widest stroke is 10."""


def ink_masks(picture: npt.NDArray[np.uint8]) -> dict[str, Mask]:
    """Return a mask for each ink of a picture, uint8 (H, W, 3): red, green and dark, without absent ones.

    Pixels of at least half the strongest colour are ink: the edge of an anti-aliased stroke lies there.
    """
    red, green, blue = (picture[..., channel].astype(np.int16) for channel in range(3))
    redness = red - np.maximum(green, blue)
    greenness = green - np.maximum(red, blue)
    colored = (redness >= MIN_COLOR) | (greenness >= MIN_COLOR)
    darkness = np.where(colored, 0, 255 - picture.mean(axis=2)).astype(np.int16)
    masks = {}
    for name, strength in (("red", redness), ("green", greenness), ("dark", darkness)):
        strongest = int(strength.max())
        if strongest >= MIN_COLOR:
            masks[name] = strength >= max(MIN_COLOR, strongest / 2)
    return masks


def main_mark(mask: Mask) -> Mask:
    """Return the one connected mark that has nearly all of the ink.

    Raises
    ------
    SketchError
        There is too little ink or too much, or it forms several marks.
    """
    count = int(mask.sum())
    if count < MIN_INK:
        raise SketchError(f"the sketch has {count} drawn pixels, it needs at least {MIN_INK} (of 512 x 512)")
    if count > MAX_INK * mask.size:
        raise SketchError(
            f"{count / mask.size:.0%} of the picture is ink, at most {MAX_INK:.0%} may be: "
            "draw a line on a white ground"
        )
    rest, left = mask.copy(), count
    while left > (1 - _MAIN_INK) * count:
        row, column = np.unravel_index(int(rest.argmax()), rest.shape)
        mark = geodesic_levels(rest, (int(row), int(column))) >= 0
        if mark.sum() >= _MAIN_INK * count:
            return mark
        rest &= ~mark
        left = int(rest.sum())
    raise SketchError("the sketch consists of several separate marks, exactly one stroke is expected")


def geodesic_levels(mask: Mask, start: tuple[int, int], *, corners: bool = True) -> Levels:
    """Return the number of steps from `start` (row, column) to each pixel inside the mask.

    Steps go to 4 neighbours and to 8 neighbours in turn. So pixels within a number of steps form an octagon,
    and steps differ from the Euclidean distance by at most 6 %. With `corners=False` all steps go to 4
    neighbours and do not cross a diagonal line of pixels.

    Returns
    -------
    int32, shape of the mask
        Number of steps, -1 where a pixel is not reached.
    """
    row_length = mask.shape[1] + 2
    free = np.pad(mask, 1).ravel()
    levels = np.full(free.size, -1, dtype=np.int32)
    edges = np.array([-row_length, -1, 1, row_length])
    both = np.concatenate([edges, [-row_length - 1, -row_length + 1, row_length - 1, row_length + 1]])
    frontier = np.array([(start[0] + 1) * row_length + start[1] + 1])
    before = frontier[:0]
    levels[frontier], free[frontier] = 0, False
    step = 0
    while frontier.size or before.size:
        step += 1
        diagonal = corners and step % 2 == 0
        # A pixel that was left to its 4 neighbours only is left to its diagonal ones a step later.
        front = np.concatenate([frontier, before]) if diagonal else frontier
        reach = (front[:, None] + (both if diagonal else edges)).ravel()
        reach = np.unique(reach[free[reach]])
        levels[reach], free[reach] = step, False
        before, frontier = (frontier if corners and not diagonal else frontier[:0]), reach
    shape = (mask.shape[0] + 2, row_length)
    return levels.reshape(shape)[1:-1, 1:-1]


def filled(mask: Mask) -> Mask:
    """Return the mask together with the pixels that it encloses."""
    outside = geodesic_levels(np.pad(~mask, 1, constant_values=True), (0, 0), corners=False) >= 0
    return np.asarray(~outside[1:-1, 1:-1])


def pixels_of(mask: Mask) -> Floats:
    """Return the middles (K, 2) of the K pixels of a mask, (x, y) in pixels."""
    rows, columns = np.nonzero(mask)
    return np.column_stack([columns, rows]).astype(np.float64) + 0.5


def half_width(mask: Mask, point: Floats) -> float:
    """Return the radius [pixels] of the largest disc of ink around a point, 0 for a point outside the ink."""
    column, row = int(point[0]), int(point[1])
    top, left = max(row - _WINDOW, 0), max(column - _WINDOW, 0)
    window = mask[top : row + _WINDOW + 1, left : column + _WINDOW + 1]
    paper = pixels_of(~window) + np.array([left, top])
    if not paper.size:
        return float(_WINDOW)
    nearest = float(np.linalg.norm(paper - point, axis=1).min())
    # The disc ends at the edge of the paper's pixel, not at its middle.
    return max(nearest - 0.5, 0.0)

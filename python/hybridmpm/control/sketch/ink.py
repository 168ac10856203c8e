"""Ink of a picture: its mask, coverage, distances along it, and its marks."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image

from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.errors import SketchError

Mask: TypeAlias = npt.NDArray[np.bool_]
Levels: TypeAlias = npt.NDArray[np.int32]
Color: TypeAlias = Literal["red", "green", "other"]

MIN_INK = 40
"""Smallest number of drawn pixels in a sketch, those of a stroke of 2 x 20 pixels."""
MAX_INK = 0.3
"""Largest fraction of the picture that may be ink; a photograph or a filled shape has more."""
MIN_COLOR = 32
"""Weakest contrast to the ground that is ink, and least excess of red or green, of 255."""
_FULL = 90.0
"""Percentile of the contrasts of ink that stands for a covered pixel; thin lines cover few pixels in full."""
MAX_GAP = 12
"""Widest gap between two pieces of one mark [pixels]; a hand that lifts the pen leaves such gaps."""
Pieces: TypeAlias = npt.NDArray[np.int64]
_COARSE = 3
"""Distance from ink [pixels] up to which colours are blurred where a file keeps half of their pixels."""
_NOISE = 95.0
"""Percentile of the weaker contrasts up to which they are noise."""
_STRAY = 0.1
"""Least share of one colour's ink to that of the other from which both are sketches."""
_MAIN_INK = 0.8
"""Smallest fraction of the ink that the main mark must have; the rest is dust."""
MAX_PIECES = 8
"""Largest number of pieces of one mark."""
_DUST = 0.01
"""Largest share of the ink of a piece that counts as dust and is not joined to the mark."""
_BLOCK = 16
"""Side of the blocks whose medians show how a picture is lit [pixels]."""
_WINDOW = 7
"""Number of blocks across over which the median is taken, so that lines and heads do not count."""
_LIT = 16
"""Least difference between the lights of two places, of 255, that is evened out."""
_EDGE = 40
"""Largest difference between neighbouring blocks; at the edge of a filled shape it is larger."""
_SAMPLES = 1500
"""Largest number of pixels between which gaps are measured."""


@dataclass(frozen=True)
class Ink:
    """The ink of one colour."""

    color: Color
    coverage: Floats
    """Part of each pixel that is ink, (512, 512) in [0, 1]. The edge of a smoothed line is at a half."""

    @property
    def mask(self) -> Mask:
        """Pixels with a coverage of at least a half, bool (512, 512)."""
        return self.coverage >= 0.5


def read_ink(picture: npt.NDArray[np.uint8], *, is_lossy: bool = False) -> Ink:
    """Return the ink of a picture, uint8 (512, 512, 3), whose ground is the colour of most pixels.

    Where light falls unevenly on the ground, as on photographed paper, it is evened out. Red ink is taken
    where there is any, else green ink, else all that differs from the ground. `is_lossy` is for pictures of
    JPEG and WebP files.

    Raises
    ------
    SketchError
        The picture is blank, has red and green ink, too few drawn pixels or too many.
    """
    # One contiguous array for each colour: numpy is several times as slow along an axis of three.
    given = np.ascontiguousarray(np.moveaxis(picture, -1, 0)).astype(np.int16)
    channels = _evenly_lit(given)
    red, green, blue = (channel - np.int16(_middle(channel)) for channel in channels)
    redness, greenness = red - np.maximum(green, blue), green - np.maximum(red, blue)
    colored = (redness >= MIN_COLOR) | (greenness >= MIN_COLOR)
    strengths: dict[Color, npt.NDArray[np.int16]] = {
        "red": redness,
        "green": greenness,
        "other": np.where(colored, np.int16(0), np.maximum(np.maximum(abs(red), abs(green)), abs(blue))),
    }
    inks = [Ink(color, _coverage(strength)) for color, strength in strengths.items()]
    counts = [int(ink.mask.sum()) for ink in inks]
    if not any(counts):
        raise SketchError("the sketch is blank: draw a red arrow or a green outline on white")
    # A few stray pixels of another colour are no second sketch, nor is the edge of a line in a JPEG.
    if min(counts[:2]) >= max(MIN_INK, _STRAY * max(counts[:2])):
        raise SketchError("the sketch has red and green ink: send one arrow or one outline at a time")
    colored_ink = int(np.argmax(counts[:2]))
    chosen = colored_ink if counts[colored_ink] >= MIN_INK else int(np.argmax(counts))
    if counts[chosen] < MIN_INK:
        raise SketchError(
            f"the sketch has {counts[chosen]} drawn pixels, it needs at least {MIN_INK} (of 512 x 512)"
        )
    fraction = counts[chosen] / inks[chosen].coverage.size
    if fraction > MAX_INK:
        raise SketchError(
            f"{fraction:.0%} of the picture is ink, at most {MAX_INK:.0%} may be: "
            "draw a line on an even ground"
        )
    ink = inks[chosen]
    is_photographed = is_lossy or channels is not given
    return _sharpened(ink, np.stack([red, green, blue])) if is_photographed and chosen < 2 else ink


def _sharpened(ink: Ink, apart: npt.NDArray[np.int16]) -> Ink:
    """Return ink by all that sets it apart from the ground (3, 512, 512): files may keep colours coarsely."""
    near = grown(ink.mask, _COARSE)
    color = np.median(apart[:, ink.coverage >= 1], axis=1)
    strength = np.where(near, np.tensordot(color, apart, 1) / np.hypot.reduce(color), 0)
    return Ink(ink.color, _coverage(np.rint(strength).astype(np.int16)))


def _evenly_lit(channels: npt.NDArray[np.int16]) -> npt.NDArray[np.int16]:
    """Return channels (3, 512, 512) as they would be if the ground were lit as it is in most places."""
    side = channels.shape[-1] // _BLOCK
    blocks = channels.reshape(3, side, _BLOCK, side, _BLOCK).swapaxes(2, 3).reshape(3, side, side, -1)
    medians = np.median(blocks, axis=-1)
    if np.ptp(medians, axis=(1, 2)).max() < _LIT:
        return channels
    padded = np.pad(medians, ((0, 0), (_WINDOW // 2,) * 2, (_WINDOW // 2,) * 2), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (_WINDOW, _WINDOW), axis=(1, 2))
    light = np.median(windows, axis=(-2, -1))
    steps = max(np.abs(np.diff(light, axis=axis)).max() for axis in (1, 2))
    if np.ptp(light, axis=(1, 2)).max() < _LIT or steps > _EDGE:
        return channels
    even = np.empty_like(channels)
    for channel, lit, out in zip(channels, light, even, strict=True):
        fine = Image.fromarray(lit.astype(np.float32)).resize(channel.shape, Image.Resampling.BICUBIC)
        factor = _middle(channel) / np.maximum(np.asarray(fine), 1.0)
        out[:] = np.minimum(np.rint(channel * factor), 255)
    return even


def _middle(values: npt.NDArray[np.int16]) -> int:
    """Return the median of values from 0 to 255; counting them is ten times as fast as sorting."""
    counts = np.cumsum(np.bincount(values.ravel(), minlength=256))
    return int(np.searchsorted(counts, values.size / 2))


def _coverage(strength: npt.NDArray[np.int16]) -> Floats:
    is_clear = strength >= MIN_COLOR
    if not is_clear.any():
        return np.zeros(strength.shape)
    coverage = np.zeros(strength.shape)
    # The noise of a camera and the blocks of a JPEG; 0 in a picture that was drawn.
    noise = max(float(np.percentile(strength[~is_clear], _NOISE)), 0.0) if not is_clear.all() else 0.0
    drawn = strength > noise
    full = np.percentile(strength[is_clear], _FULL) - noise
    coverage[drawn] = np.minimum((strength[drawn] - noise) / full, 1.0)
    return coverage


def pixels_of(mask: Mask) -> Floats:
    """Return the middles (K, 2) of the K pixels of a mask, (x, y) in pixels."""
    rows, columns = np.nonzero(mask)
    return np.column_stack([columns, rows]).astype(np.float64) + 0.5


def coverage_at(coverage: Floats, points: Floats) -> Floats:
    """Return the coverage (...,) at points (..., 2): linear between pixels, 0 off the picture."""
    padded = np.pad(coverage, 1)
    x, y = np.moveaxis(np.clip(points + 0.5, 0.0, np.array(coverage.shape[::-1]) + 0.999), -1, 0)
    column, row = x.astype(np.intp), y.astype(np.intp)
    right, down = x - column, y - row
    across, below = np.minimum(column + 1, padded.shape[1] - 1), np.minimum(row + 1, padded.shape[0] - 1)
    upper = padded[row, column] * (1 - right) + padded[row, across] * right
    lower = padded[below, column] * (1 - right) + padded[below, across] * right
    return np.asarray(upper * (1 - down) + lower * down)


def geodesic_levels(mask: Mask, start: tuple[int, int], most: int) -> Levels:
    """Return the number of steps from `start` (row, column) to each pixel inside the mask.

    Steps go to 4 neighbours and to 8 neighbours in turn. So pixels within a number of steps form an octagon,
    and steps differ from the Euclidean distance by at most 6 %.

    Returns
    -------
    int32, shape of the mask
        Number of steps, -1 where a pixel is not reached within `most` steps.
    """
    row_length = mask.shape[1] + 2
    free = np.pad(mask, 1).ravel()
    levels = np.full(free.size, -1, dtype=np.int32)
    place = np.empty(free.size, dtype=np.int32)
    edges = np.array([-row_length, -1, 1, row_length])
    both = np.concatenate([edges, [-row_length - 1, -row_length + 1, row_length - 1, row_length + 1]])
    frontier = np.array([(start[0] + 1) * row_length + start[1] + 1])
    before = frontier[:0]
    levels[frontier], free[frontier] = 0, False
    step = 0
    while step < most and (frontier.size or before.size):
        step += 1
        diagonal = step % 2 == 0
        # A step to the 4 neighbours of a pixel is followed by a step to its diagonal ones.
        front = np.concatenate([frontier, before]) if diagonal else frontier
        reach = (front[:, None] + (both if diagonal else edges)).ravel()
        reach = reach[free[reach]]
        # A pixel that is reached several times keeps one place in the list; this is faster than sorting.
        places = np.arange(len(reach), dtype=np.int32)
        place[reach] = places
        reach = reach[place[reach] == places]
        levels[reach], free[reach] = step, False
        before, frontier = (frontier[:0] if diagonal else frontier), reach
    shape = (mask.shape[0] + 2, row_length)
    return levels.reshape(shape)[1:-1, 1:-1]


def main_mark(mask: Mask) -> tuple[Mask, Mask]:
    """Return the mark that has nearly all of the ink, and the same with its gaps bridged by thin lines.

    Raises
    ------
    SketchError
            The ink forms several marks.
    """
    near = labels(grown(mask, MAX_GAP // 2))
    ink = np.bincount(near[mask])
    main = int(ink.argmax())
    share = ink[main] / ink.sum()
    if share < _MAIN_INK:
        raise SketchError(
            f"the sketch consists of several separate marks, {share:.0%} of the ink is in the largest: draw "
            f"exactly one arrow or one outline, without gaps wider than {MAX_GAP} pixels (of 512)"
        )
    mark = mask & (near == main)
    pieces = labels(mark)
    sizes = np.bincount(pieces.ravel())
    sizes[0] = 0
    large = np.flatnonzero(sizes > _DUST * sizes.sum())
    if len(large) > MAX_PIECES or sizes[large].sum() < _MAIN_INK * sizes.sum():
        raise SketchError(
            f"the sketch consists of {(sizes > 0).sum()} separate marks: draw one arrow or one outline, "
            f"in at most {MAX_PIECES} pieces"
        )
    names = np.zeros_like(sizes)
    names[large] = large
    return mark, _bridged(names[pieces])


def labels(mask: Mask) -> Pieces:
    """Return a number from 1 on for each 8-connected piece of a mask, int64 of its shape; 0 outside.

    Runs of pixels in a row are united with the runs that they touch in the next row. Each round at least
    halves the pieces that are still to be united, so noise costs little more than a line.
    """
    width = mask.shape[1]
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8).ravel())
    # Rows are padded to a length at which runs of one row cannot touch those of another but the next.
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    row = width + 2
    first = np.searchsorted(ends, starts + row, side="left")
    last = np.searchsorted(starts, ends + row, side="right")
    touching = np.maximum(last - first, 0)
    upper = np.repeat(np.arange(len(starts)), touching)
    lower = np.arange(touching.sum()) - np.repeat(np.cumsum(touching) - touching, touching) + first[upper]
    root = np.arange(len(starts))
    while True:
        a, b = root[upper], root[lower]
        if np.array_equal(a, b):
            break
        np.minimum.at(root, np.maximum(a, b), np.minimum(a, b))
        while not np.array_equal(root, root[root]):
            root = root[root]
    names = np.unique(root, return_inverse=True)[1] + 1
    result = np.zeros(mask.shape, dtype=np.int64)
    result[mask] = np.repeat(names, ends - starts)
    return result


def grown(mask: Mask, radius: int) -> Mask:
    """Return the pixels within a distance [pixels] of a mask."""
    padded = np.pad(mask, radius)
    height, width = mask.shape
    grown_mask = np.zeros(mask.shape, dtype=bool)
    for down in range(2 * radius + 1):
        reach = int(np.sqrt(radius**2 - (down - radius) ** 2))
        for right in range(radius - reach, radius + reach + 1):
            grown_mask |= padded[down : down + height, right : right + width]
    return grown_mask


def _bridged(pieces: Pieces) -> Mask:
    """Return a mark whose pieces are joined by lines between their nearest pixels, shortest lines first."""
    bridged = pieces > 0
    points, names = _sampled(pieces)
    joined = names == names[0]
    if joined.all():
        return bridged
    square = ((points[:, None] - points) ** 2).sum(axis=2)
    while not joined.all():
        between = square[joined][:, ~joined]
        here, there = np.unravel_index(int(between.argmin()), between.shape)
        _draw_line(bridged, points[joined][here], points[~joined][there])
        joined |= names == names[~joined][there]
    return bridged


def _sampled(pieces: Pieces) -> tuple[Floats, Pieces]:
    """Return pixels (K, 2) at the edges of pieces, some of each, and the number (K,) of the piece of each."""
    mark = pieces > 0
    inner = mark.copy()
    inner[1:] &= mark[:-1]
    inner[:-1] &= mark[1:]
    inner[:, 1:] &= mark[:, :-1]
    inner[:, :-1] &= mark[:, 1:]
    edge = mark & ~inner
    points, names = pixels_of(edge), pieces[edge]
    order = np.argsort(names, kind="stable")
    points, names = points[order], names[order]
    kept = np.zeros(len(points), dtype=bool)
    kept[:: max(1, -(-len(points) // _SAMPLES))] = True
    kept[np.unique(names, return_index=True)[1]] = True
    return points[kept], names[kept]


def _draw_line(mask: Mask, start: Floats, end: Floats) -> None:
    steps = np.linspace(start, end, 2 * int(np.hypot(*(end - start))) + 2)
    columns, rows = steps.astype(np.intp).T
    for shift in (0, 1):
        mask[np.minimum(rows + shift, mask.shape[0] - 1), columns] = True

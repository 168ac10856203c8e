"""Which pixels of ink belong to one mark: connected ones, and pieces with a small gap between them."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from hybridmpm.control.sketch.picture.ink import Mask, pixels_of
from hybridmpm.control.sketch.sketch import Floats
from hybridmpm.errors import SketchError

MAX_GAP = 12
"""Widest gap between two pieces of one mark [pixels]; a hand that lifts the pen leaves such gaps."""
Pieces: TypeAlias = npt.NDArray[np.int64]

_MAIN_INK = 0.8
"""Smallest fraction of the ink that the main mark must have; the rest is dust."""
MAX_PIECES = 8
"""Largest number of pieces of one mark."""
_DUST = 0.01
"""Largest share of the ink that a piece may have and be dust, which is not joined to the mark."""
_SAMPLES = 1500
"""Largest number of pixels between which gaps are measured."""


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

"""`Region`: the part of an oval that fluid can fill, grown or shrunk to what the fluid needs."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.oval import Oval
from hybridmpm.control.goal.room import Room
from hybridmpm.errors import SketchError

Fill = Literal["even", "shrink"]
"""What is done with an oval larger than the fluid: fill it evenly, or shrink it to the fluid's volume."""

_ROOM = 1.03
"""Room that settled fluid takes over its volume at rest [-]."""
_CELLS_PER_PARTICLE = {2: 6, 3: 6}
"""Cells of the raster for each particle, by dimension; places are centres of groups of cells."""


@dataclass(frozen=True, eq=False)
class Region:
    """An oval of the size that is filled, without what walls and obstacles take of it."""

    oval: Oval
    """As it was drawn."""
    room: Room
    scale: float
    """Factor on the semi-axes: above 1 where the oval was grown to the fluid's volume."""
    cells: Floats
    """Centres (M, D) of equal cells that make up the region [m]."""
    volume: float
    """Volume of the cells, in 2D their area [m^D]."""

    def reaches(self, x: Floats, scale: float) -> npt.NDArray[np.bool_]:
        """Tell which points (N, D) lie in the free part of the oval grown by a factor; (N,)."""
        return self.room.is_free(x) & (self.oval.level(x) <= scale)


def region_of(oval: Oval, room: Room, *, volume: float, particles: int, fill: Fill) -> Region:
    """Return the region of an oval that a fluid is to fill.

    Where the free part of the oval is smaller than the fluid, the oval is grown in the same shape until its
    free part is as large. Where it is larger, `fill` says what happens.

    Parameters
    ----------
    oval : Oval
    room : Room
        Walls and obstacles, which hold no fluid.
    volume : float
        Volume of the fluid at rest [m^D].
    particles : int
        Number of particles.
    fill : "even" or "shrink"

    Raises
    ------
    SketchError
        No part of the oval is free.
    """
    if not room.is_free(oval.sample()).any():
        raise SketchError(
            "no part of the oval is free: it lies in obstacles or outside of the walls; draw it where the "
            "fluid can be"
        )
    volume *= _ROOM
    wanted = max(volume, oval.volume if fill == "even" else 0.0)
    side = (wanted / (_CELLS_PER_PARTICLE[len(oval.center)] * particles)) ** (1 / len(oval.center))
    grown = max(1.0, (volume / oval.volume) ** (1 / len(oval.center)))
    cells, level = np.empty((0, len(oval.center))), np.empty(0)
    # Boxes in which the region lies, if less and less of the oval is free; the last one is the whole room.
    for reach in (1.3, 2.0, 3.5, np.inf):
        lower, upper = (room.lower, room.upper) if np.isinf(reach) else oval.box(reach * grown)
        cells = _cells(room, side, np.maximum(lower, room.lower), np.minimum(upper, room.upper))
        level = oval.level(cells)
        if (level <= reach * grown).sum() * side ** len(oval.center) >= volume:
            break
    needed = min(len(level), max(1, round(volume / side ** len(oval.center))))
    fitting = float(np.partition(level, needed - 1)[needed - 1])
    scale = fitting if fill == "shrink" else max(1.0, fitting)
    kept = cells[level <= scale]
    return Region(oval, room, scale, kept, len(kept) * side ** len(oval.center))


def _cells(room: Room, side: float, lower: Floats, upper: Floats) -> Floats:
    """Return the centres (M, D) of the free cells of a lattice that covers a box."""
    axes = [
        a + side * (np.arange(max(1, round((b - a) / side))) + 0.5) for a, b in zip(lower, upper, strict=True)
    ]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    return np.asarray(cells[room.is_free(cells)], dtype=np.float64)

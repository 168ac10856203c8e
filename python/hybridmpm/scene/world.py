"""`World`: the box in which a scene lies, and the check that all of the scene lies in it."""

import math
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from hybridmpm.scene.fields import LONGEST, Fault, Range, Record
from hybridmpm.scene.rows import Rows

MOST_CELLS = 4096
"""Largest number of grid cells along an axis."""
MOST_CELLS_3D = 512**3
"""Largest number of cells in 3D; the dense grid takes 2.3 GB there."""
FEWEST_CELLS = 8
"""Smallest number of grid cells along an axis."""
_ROUNDING = 1e-6
"""Part of a cell by which a size may exceed a whole number of cells by rounding."""
_PLACES = ("lower", "upper", "center", "start", "end", "point", "vertices")
_LENGTHS = ("radius", "thickness")
_NAMED = 50
"""Largest number of corners of a surface that are named."""


class World(Record):
    """Box from the origin to `size`, in which all of a scene lies."""

    size: Annotated[
        tuple[Annotated[float, Range(0, LONGEST, "m", open_low=True)], ...], Field(min_length=2, max_length=3)
    ] = Field(description="Length of the world along each axis, D numbers [m].")


def cells_of(size: tuple[float, ...], resolution: int) -> tuple[int, ...]:
    """Return the grid cells along each axis: whole ones, of which there are `resolution` in a metre."""
    return tuple(math.ceil(length * resolution - _ROUNDING) for length in size)


def rounded_up(size: tuple[float, ...], resolution: int) -> str | None:
    """Return a message where a world is no whole number of cells long; it says what the grid has."""
    cells = cells_of(size, resolution)
    parts = [
        f"{count} cells, {count / resolution:.6g} m, for {length:.6g} m along {axis}"
        for axis, length, count in zip("xyz", size, cells, strict=False)
        if count - length * resolution > _ROUNDING
    ]
    if not parts:
        return None
    return (
        f"the grid is rounded up to whole cells of {1 / resolution:.4g} m: {' and '.join(parts)}; walls and "
        "obstacles stay where they are"
    )


def coarsest_grid(size: tuple[float, ...]) -> int:
    """Return the fewest cells per metre with which a world has enough cells along each axis."""
    # The last cell along an axis may reach beyond the world.
    return math.floor((FEWEST_CELLS - 1) / min(size) + _ROUNDING) + 1


def grid_faults(size: tuple[float, ...], resolution: int) -> list[Fault]:
    """List the faults of a grid of so many cells per metre over a world of this size."""
    least = coarsest_grid(size)
    most = math.floor(MOST_CELLS / max(size) + _ROUNDING)
    if len(size) == 3:
        most = min(most, math.floor((MOST_CELLS_3D / math.prod(size)) ** (1 / 3) + _ROUNDING))
    if least > most:
        shape = " x ".join(f"{length:g}" for length in size)
        text = (
            f"is too long for its width: {shape} m needs {least} cells per metre for {FEWEST_CELLS} cells "
            f"across, and may have {most}"
        )
        return [(("world", "size"), text)]
    if least <= resolution <= most:
        return []
    return [
        (("resolution",), f"must be in [{least}, {most}] cells per metre in this world, got {resolution}")
    ]


def outside(part: BaseModel, size: tuple[float, ...]) -> Iterator[Fault]:
    """Yield the faults of what a part of a scene has outside of a world: its points and its lengths."""
    longest = max(size)
    for name, value in part:
        if name in _LENGTHS and value > longest:
            yield (name,), f"must be in (0, {longest:g}] m, got {value:g}"
        elif name in _PLACES and isinstance(value, tuple | Rows):
            points: dict[tuple[str | int, ...], Any] = {(name,): value}
            if isinstance(value, Rows):
                beyond = np.flatnonzero((np.asarray(value) > size).any(axis=1))[:_NAMED]
                points = {(name, index): value[index] for index in beyond.tolist()}
            elif value and isinstance(value[0], tuple):
                points = {(name, index): point for index, point in enumerate(value)}
            for where, point in points.items():
                for axis, (x, length) in enumerate(zip(point, size, strict=True)):
                    if x > length:
                        yield (*where, axis), f"must be in [0, {length:g}] m, got {x:g}"
        elif name == "motion" and value is not None:
            yield from (((name, *where), text) for where, text in outside(value, size))

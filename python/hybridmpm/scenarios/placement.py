"""Random places, free of collisions, for the blocks and ramps of the scenarios.

Blocks are at least `CLEARANCE` cells from each other and from ramps, so that no particle starts within the
reach of the grid stencil of another body or of a ramp. The caller gives the random generator.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.scene import SegmentObstacle

CLEARANCE = 2.0
"""Smallest gap between bodies, and between bodies and ramps [cells]."""
RAMP_GAP = 8.0
"""Smallest gap between ramps [cells], so that material can flow between them."""

_ATTEMPTS = 200
"""Number of places tried for a block or a ramp."""
_RAMP_POINTS = 33
"""Number of points on a ramp's centre line from which its distances are measured."""

Vector = npt.NDArray[np.float64]
Span = tuple[float, float]
"""Lower and upper end of a range."""


class NoRoomError(Exception):
    """No place was found for a block or ramp in `_ATTEMPTS` attempts; draw the whole scene anew."""


@dataclass(frozen=True)
class Block:
    """An axis-aligned box, given by two opposite corners (D,) [m]."""

    lower: Vector
    upper: Vector

    def distance(self, x: Vector) -> Vector:
        """Return the distances (N,) of points (N, D) from the box [m], 0 inside."""
        gap = np.maximum(np.maximum(self.lower - x, x - self.upper), 0.0)
        return np.asarray(np.linalg.norm(gap, axis=1))

    def gap(self, other: "Block") -> float:
        """Return the distance between this box and another [m], 0 where they touch."""
        apart = np.maximum(np.maximum(self.lower - other.upper, other.lower - self.upper), 0.0)
        return float(np.linalg.norm(apart))


def draw_blocks(
    rng: np.random.Generator, *, room: Block, count: int, measure: float, aspect: Span, clearance: float
) -> list[Block]:
    """Place blocks at random that together have a given area or volume.

    Parameters
    ----------
    rng : numpy Generator
    room : Block
        Box that contains the blocks.
    count : int >= 1
        Number of blocks.
    measure : float > 0
        Sum of the blocks' areas [m^2] or volumes [m^3]. No block has more than twice that of another.
    aspect : (low, high)
        Range of a block's sides, relative to the side of a cube of the same measure. The sides drawn from it
        are then scaled to the block's measure.
    clearance : float >= 0
        Smallest gap between two blocks [m].

    Raises
    ------
    NoRoomError
        A block found no place.
    """
    weights = rng.uniform(0.5, 1.0, count)
    blocks: list[Block] = []
    for weight in weights / weights.sum():
        block = _draw_block(
            rng, room=room, measure=weight * measure, aspect=aspect, clearance=clearance, others=blocks
        )
        blocks.append(block)
    return blocks


def _draw_block(
    rng: np.random.Generator,
    *,
    room: Block,
    measure: float,
    aspect: Span,
    clearance: float,
    others: list[Block],
) -> Block:
    space = room.upper - room.lower
    for _ in range(_ATTEMPTS):
        sides = rng.uniform(*aspect, len(space))
        sides *= (measure / sides.prod()) ** (1.0 / len(space))
        if (sides > space).any():
            continue
        lower = room.lower + rng.uniform(0.0, 1.0, len(space)) * (space - sides)
        block = Block(lower, lower + sides)
        if all(block.gap(other) >= clearance for other in others):
            return block
    raise NoRoomError


@dataclass(frozen=True, kw_only=True)
class RampShape:
    """Ranges from which ramps are drawn."""

    length: Span
    """Length of a ramp [m]."""
    thickness: Span
    """Thickness of a ramp [m]."""
    steepest: float
    """Largest angle of a ramp to the horizontal [degrees]."""


def draw_ramps(
    rng: np.random.Generator, *, room: Block, count: int, shape: RampShape, blocks: list[Block], dx: float
) -> list[SegmentObstacle]:
    """Place up to `count` ramps at random in the (x, y) plane, clear of walls, blocks and each other.

    Ramps lie in `room`, `CLEARANCE` cells of size `dx` [m] from `blocks` and `RAMP_GAP` cells from each
    other. A ramp that finds no place is left out.

    Raises
    ------
    NoRoomError
        No ramp found a place.
    """
    ramps: list[SegmentObstacle] = []
    for _ in range(count):
        ramp = _draw_ramp(rng, room=room, shape=shape, blocks=blocks, others=ramps, dx=dx)
        if ramp is not None:
            ramps.append(ramp)
    if not ramps:
        raise NoRoomError
    return ramps


def _draw_ramp(
    rng: np.random.Generator,
    *,
    room: Block,
    shape: RampShape,
    blocks: list[Block],
    others: list[SegmentObstacle],
    dx: float,
) -> SegmentObstacle | None:
    for _ in range(_ATTEMPTS):
        length, thickness = rng.uniform(*shape.length), rng.uniform(*shape.thickness)
        angle = np.radians(rng.uniform(-shape.steepest, shape.steepest))
        half = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
        inset = np.abs(half) + thickness / 2
        center = rng.uniform(room.lower + inset, room.upper - inset)
        points = _points(center - half, center + half)
        if any(block.distance(points).min() < thickness / 2 + CLEARANCE * dx for block in blocks):
            continue
        if any(_gap(points, thickness, other) < RAMP_GAP * dx for other in others):
            continue
        start, end = (tuple(np.round(center + sign * half, 6).tolist()) for sign in (-1, 1))
        return SegmentObstacle(start=start, end=end, thickness=round(thickness, 6))
    return None


def _points(start: Vector, end: Vector) -> Vector:
    return start + np.linspace(0.0, 1.0, _RAMP_POINTS)[:, None] * (end - start)


def _gap(points: Vector, thickness: float, other: SegmentObstacle) -> float:
    others = _points(np.array(other.start), np.array(other.end))
    centers = np.linalg.norm(points[:, None] - others[None], axis=-1).min()
    return float(centers - (thickness + other.thickness) / 2)

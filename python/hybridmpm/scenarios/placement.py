"""Random, collision-free places for the blocks and ramps of the scenarios. Pure: the generator comes in.

Everything keeps `CLEARANCE` cells from everything else, so that no particle starts within the reach of
another body's or a ramp's grid stencil.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.scene import SegmentObstacle

CLEARANCE = 2.0
"""Smallest gap between bodies, and between bodies and ramps, in cells."""
RAMP_GAP = 8.0
"""Smallest gap between ramps, in cells: material has to flow between them."""

_ATTEMPTS = 200
_RAMP_POINTS = 33

Vector = npt.NDArray[np.float64]
Span = tuple[float, float]


class NoRoomError(Exception):
    """Nothing fitted in the attempts allowed; draw the scene anew."""


@dataclass(frozen=True)
class Block:
    """An axis-aligned box."""

    lower: Vector
    upper: Vector

    def distance(self, x: Vector) -> Vector:
        """Distance [m] of points (N, D) to the box, 0 inside; shape (N,)."""
        gap = np.maximum(np.maximum(self.lower - x, x - self.upper), 0.0)
        return np.asarray(np.linalg.norm(gap, axis=1))

    def gap(self, other: "Block") -> float:
        """Distance [m] between two boxes, 0 where they touch."""
        apart = np.maximum(np.maximum(self.lower - other.upper, other.lower - self.upper), 0.0)
        return float(np.linalg.norm(apart))


def draw_blocks(
    rng: np.random.Generator, *, room: Block, count: int, measure: float, aspect: Span, clearance: float
) -> list[Block]:
    """Place blocks at random that together fill a given measure.

    Parameters
    ----------
    rng : numpy Generator
    room : Block
        They lie inside it.
    count : int >= 1
    measure : float > 0
        Sum of their areas [m^2] or volumes [m^3]; each has between half and twice an equal share.
    aspect : (low, high)
        Range of the sides, relative to a cube of the same measure, before they are rescaled to it.
    clearance : float >= 0
        Smallest gap between two of them [m].

    Raises
    ------
    NoRoomError
    """
    shares = rng.uniform(0.5, 1.0, count)
    blocks: list[Block] = []
    for share in shares / shares.sum():
        block = _draw_block(
            rng, room=room, measure=share * measure, aspect=aspect, clearance=clearance, others=blocks
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
    """Ranges that ramps are drawn from."""

    length: Span
    """[m]"""
    thickness: Span
    """[m]"""
    steepest: float
    """Largest angle to the horizontal [degrees]."""


def draw_ramps(
    rng: np.random.Generator, *, room: Block, count: int, shape: RampShape, blocks: list[Block], dx: float
) -> list[SegmentObstacle]:
    """Place ramps at random in the (x, y) plane, clear of the walls of `room`, of `blocks` and each other.

    Raises
    ------
    NoRoomError
        The first does not fit. Later ones that do not fit are left out.
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

"""The scenes whose speed is measured: a block that falls aslant, and its splash."""

import math

import numpy as np

from hybridmpm.errors import SimulationError
from hybridmpm.mpm import MpmSolver
from hybridmpm.scene import Box, Scene

MAX_PARTICLES = 1_000_000
"""Largest number of particles that a block may be asked to have."""

_WALL_LOW, _WALL_HIGH = 0.1, 0.9
_LARGEST_SHARE = 0.5
"""Largest part of the box that a block fills; 20 000 particles at 128^2 fill it, more get a finer grid."""


def falling_block(dim: int, material: str, particles: int) -> Scene:
    """Return a scene with one block of at most `particles` particles that falls aslant.

    The grid is 128^2 or 64^3, or as fine as it takes that the block fills at most half of the box.
    """
    resolution = _resolution(dim, particles)
    spacing = 0.5 / resolution  # 2**D particles per cell
    sides = [spacing * count for count in _counts(particles, dim)]
    middle = (_WALL_LOW + _WALL_HIGH) / 2
    # On the lattice of the sampler, so that the count is exact.
    lower = [spacing * round((middle - side / 2) / spacing) for side in sides]
    return Scene(
        name=f"falling block of {material}",
        dim=dim,
        resolution=resolution,
        bodies=(
            Box(
                material=material,
                lower=tuple(lower),
                upper=tuple(a + side for a, side in zip(lower, sides, strict=True)),
                velocity=(1.0, -2.0, 0.5)[:dim],
            ),
        ),
        max_particles=2 * MAX_PARTICLES,
    )


def _resolution(dim: int, particles: int) -> int:
    per_axis = math.pow(particles / _LARGEST_SHARE, 1 / dim) / 2  # cells, at 2**D particles each
    fine_enough: int = 32 * math.ceil(per_axis / (_WALL_HIGH - _WALL_LOW) / 32)
    return max(fine_enough, 128 if dim == 2 else 64)


def _counts(particles: int, dim: int) -> list[int]:
    """Return numbers of sites along each axis, about equal, whose product is `particles` or somewhat less."""
    if dim == 1:
        return [particles]
    even = max(1, math.floor(particles ** (1.0 / dim) + 1e-9))
    exact = [count for count in range(even, even // 2, -1) if particles % count == 0]
    count = exact[0] if exact else even
    return [count, *_counts(particles // count, dim - 1)]


def require_sane(solver: MpmSolver) -> None:
    """Raise a SimulationError unless all particles are in the box and move like a splash."""
    x, v = solver.positions, solver.velocities
    inside = ((x > _WALL_LOW - solver.scene.dx) & (x < _WALL_HIGH + solver.scene.dx)).all()
    if not (inside and np.isfinite(v).all() and 0.05 < np.abs(v).max() < 50):
        raise SimulationError(f"{solver.scene.name}: the state after {solver.frame} frames is not a splash")

"""What a transport network is told of a state and of a sketch, in training and in use."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.moments import moments
from hybridmpm.control.methods.learned.spec import CELLS

CHANNELS, NUMBERS, OF_PARTICLE = 10, 16, 13
"""Channels of the grid, numbers of the whole, and numbers of each particle."""
SCALE = 0.2
"""Length by which places are divided [m]."""
_SECONDS = 0.25
"""Time by which times are divided [s], the paper's horizon."""
_ARROW_SCALE = 0.12
"""Length of a unit in the frame of an arrow's goal [m]: spread of a typical fluid."""

Floats32 = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class State:
    """N particles in 2D when control starts, all of one volume."""

    x: Floats
    """Positions (N, 2) [m]."""
    v: Floats
    """Velocities (N, 2) [m/s]."""
    sand: npt.NDArray[np.bool_]
    """Which particles are sand (N,)."""
    weight: Floats
    """Mass of each particle over that of all (N,) [-]."""
    particle_volume: float
    """Area of a particle at rest [m^2]."""
    lower: Floats
    """Lower corner of the walls (2,) [m]."""
    upper: Floats
    """Upper corner of the walls (2,) [m]."""
    gravity: Floats
    """(2,) [m/s^2]."""


@dataclass(frozen=True, eq=False)
class Aim:
    """What a sketch tells of the end."""

    mean: Floats
    """Where the centre of mass is to be (2,) [m]."""
    root: Floats | None
    """Symmetric root (2, 2) of the covariance of the particles [m]; None where an arrow leaves it open."""
    seconds: float
    """Time until then [s]."""

    @property
    def frame(self) -> Floats:
        """Matrix (2, 2) from the aim's own coordinates, whose origin is `mean`, to metres."""
        return _ARROW_SCALE * np.eye(2) if self.root is None else self.root

    def to_own(self, x: Floats) -> Floats:
        """Return points (..., 2) [m] in the aim's own coordinates [-]."""
        return np.asarray((x - self.mean) @ np.linalg.inv(self.frame).T)

    def to_metres(self, own: Floats) -> Floats:
        """Return points (..., 2) in the aim's own coordinates in metres."""
        return np.asarray(self.mean + own @ self.frame.T)


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of a transport network for B states with P particles each; float32."""

    grid: Floats32
    """(B, `CHANNELS`, `CELLS`, `CELLS`), rows along y."""
    numbers: Floats32
    """(B, `NUMBERS`)."""
    particles: Floats32
    """(B, P, `OF_PARTICLE`)."""
    places: Floats32
    """Positions (B, P, 2) between the walls, from -1 to 1."""


def inputs(
    states: Sequence[State], aims: Sequence[Aim], chosen: Sequence[npt.NDArray[np.int64] | None]
) -> Inputs:
    """Return the inputs for some states, one aim each.

    Parameters
    ----------
    states : sequence of State, of length B
    aims : sequence of Aim, of length B
    chosen : sequence of int64 (P,) or None, of length B
        Which particles are asked for; None for all. P must be the same for all states.
    """
    told = [_told(*one) for one in zip(states, aims, chosen, strict=True)]
    return Inputs(*(np.stack(column).astype(np.float32) for column in zip(*told, strict=True)))


def unit_places(x: Floats, lower: Floats, upper: Floats) -> Floats:
    """Return points (N, 2) [m] as places between the walls, from -1 to 1."""
    return np.asarray((x - lower) / (upper - lower) * 2 - 1)


def _told(
    state: State, aim: Aim, chosen: npt.NDArray[np.int64] | None
) -> tuple[Floats, Floats, Floats, Floats]:
    extent = state.upper - state.lower
    cells = (np.arange(CELLS) + 0.5) / CELLS
    at = np.stack(np.meshgrid(cells, cells), axis=-1)
    own = aim.to_own(state.lower + at * extent)
    level = np.zeros((CELLS, CELLS)) if aim.root is None else np.exp(-(own**2).sum(axis=-1) / 4)
    fill, velocity, deviation, sand = rasters(state)
    grid = np.concatenate(
        [
            fill[None],
            velocity / 2,
            deviation[None],
            sand[None],
            (at - 0.5).transpose(2, 0, 1),
            level[None],
            np.clip(own / 4, -2, 2).transpose(2, 0, 1),
        ]
    )
    mean, covariance = moments(state.x, state.weight)
    middle = (state.lower + state.upper) / 2
    root = np.zeros((2, 2)) if aim.root is None else aim.root
    numbers = np.concatenate(
        [
            [aim.root is None, state.weight @ state.sand, aim.seconds / _SECONDS - 1],
            (aim.mean - mean) / SCALE,
            root[[0, 0, 1], [0, 1, 1]] / SCALE,
            (mean - middle) / SCALE,
            4 * covariance[[0, 0, 1], [0, 1, 1]] / SCALE**2,
            [8 * len(state.x) * state.particle_volume],
            (aim.mean - middle) / SCALE,
        ]
    )
    every = slice(None) if chosen is None else chosen
    x, v = state.x[every], state.v[every]
    places = unit_places(x, state.lower, state.upper)
    # Where a particle comes from if nothing but gravity acted on it: fluid that runs back goes there.
    flight = x - v * aim.seconds + 0.5 * state.gravity * aim.seconds**2
    flight = np.clip(flight, state.lower - SCALE, state.upper + 2 * SCALE)
    particles = np.concatenate(
        [
            aim.to_own(x) / 2,
            np.clip(aim.to_own(flight) / 4, -2, 2),
            v / 2,
            v - _sampled(velocity, places),
            (x - middle) / (2 * SCALE),
            (x - mean) / SCALE,
            state.sand[every, None],
        ],
        axis=1,
    )
    return grid, numbers, particles, places


def rasters(state: State) -> tuple[Floats, Floats, Floats, Floats]:
    """Return a state on the network's grid, rows along y.

    Returns
    -------
    fill : (C, C)
        Area of the particles over that of the cell [-].
    velocity : (2, C, C)
        Mean velocity [m/s], 0 where there is nothing.
    deviation : (C, C)
        Root mean square distance of the particles' velocities from the mean [m/s].
    sand : (C, C)
        Area of the sand over that of the cell [-].
    """
    nodes, weights = _corners(unit_places(state.x, state.lower, state.upper))

    def summed(values: Floats) -> Floats:
        found = np.bincount(nodes.ravel(), (weights * values[:, None]).ravel(), CELLS**2)
        return found.astype(np.float64)

    mass = summed(np.ones(len(state.x)))
    share = state.particle_volume / (np.prod(state.upper - state.lower) / CELLS**2)
    there = mass > 1e-3
    divisor = np.where(there, mass, 1.0)
    velocity = np.stack([summed(column) for column in state.v.T]) / divisor * there
    square = summed((state.v**2).sum(axis=1)) / divisor * there
    deviation = np.sqrt(np.maximum(square - (velocity**2).sum(axis=0), 0.0))
    sand = summed(state.sand.astype(np.float64))
    shape = (CELLS, CELLS)
    return (
        (mass * share).reshape(shape),
        velocity.reshape(2, *shape),
        deviation.reshape(shape),
        (sand * share).reshape(shape),
    )


def _sampled(field: Floats, places: Floats) -> Floats:
    """Return the values (P, K) of a field (K, C, C) at places (P, 2) from -1 to 1, linearly between cells."""
    nodes, weights = _corners(places)
    return np.asarray(np.einsum("pc,kpc->pk", weights, field.reshape(len(field), -1)[:, nodes]))


def _corners(places: Floats) -> tuple[npt.NDArray[np.int64], Floats]:
    """Return the four cells (P, 4) whose centres are around places (P, 2), and their weights."""
    at = np.clip((places + 1) / 2 * CELLS - 0.5, 0, CELLS - 1)
    low = np.minimum(at.astype(np.int64), CELLS - 2)
    part = at - low
    nodes, weights = [], []
    for dx in (0, 1):
        for dy in (0, 1):
            nodes.append((low[:, 1] + dy) * CELLS + low[:, 0] + dx)
            weights.append(np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1]))
    return np.stack(nodes, axis=1), np.stack(weights, axis=1)

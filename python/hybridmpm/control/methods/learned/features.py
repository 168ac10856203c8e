"""Features of a state and of a sketch for a transport network, computed alike in training and in use.

A state in 3D is seen on three planes, a state in 2D on its own. One network reads all planes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybridmpm.control.goal.cloud import Floats
from hybridmpm.control.goal.moments import moments
from hybridmpm.control.goal.room import Room
from hybridmpm.control.methods.learned.spec import CELLS

PLANES: dict[int, tuple[tuple[int, int], ...]] = {2: ((0, 1),), 3: ((0, 1), (2, 1), (0, 2))}
"""Planes by dimension, each by its horizontal and its vertical axis. The first is the front view."""
SCALE = 0.2
"""Length by which places are divided [m]."""
_SECONDS = 0.25
"""Time by which times are divided [s], the paper's horizon."""
_ARROW_SCALE = 0.12
"""Length of a unit in the frame of an arrow's goal [m]: spread of a typical fluid."""
_THICK = {2: 1.0, 3: 8.0}
"""Factor on the fill of a cell, by dimension: in 3D fluid takes a small part of a column."""
_MUCH = {2: 8.0, 3: 30.0}
"""Factor on the volume of the fluid, by dimension [1/m^D]."""
_FARTHEST = {2: np.inf, 3: 4.0}
"""Largest coordinate of a particle in the aim's frame, by dimension: beside a thin oval all is far away."""

Floats32 = npt.NDArray[np.float32]


def channels(dim: int, *, obstacles: bool) -> int:
    """Return the number of channels of a plane, for networks that see obstacles and for others."""
    return (10 if dim == 2 else 13) + 2 * obstacles


def numbers(dim: int) -> int:
    """Return how many numbers describe the whole."""
    return 16 if dim == 2 else 22


def of_particle(dim: int) -> int:
    """Return how many numbers describe a particle."""
    return 6 * dim + 1


@dataclass(frozen=True, eq=False)
class State:
    """N particles in D dimensions when control starts, all of one volume."""

    x: Floats
    """Positions (N, D) [m]."""
    v: Floats
    """Velocities (N, D) [m/s]."""
    sand: npt.NDArray[np.bool_]
    """Whether each particle is sand (N,)."""
    weight: Floats
    """Mass of each particle over that of all (N,) [-]."""
    particle_volume: float
    """Volume of a particle at rest, in 2D its area [m^D]."""
    lower: Floats
    """Lower corner of the walls (D,) [m]."""
    upper: Floats
    """Upper corner of the walls (D,) [m]."""
    gravity: Floats
    """(D,) [m/s^2]."""
    distance: Floats | None = None
    """Signed distance of the nearest obstacle from the centre of each of the `CELLS` cells along each axis, D
    axes [m]; None without obstacles."""

    @property
    def dim(self) -> int:
        """Dimension D."""
        return len(self.gravity)


@dataclass(frozen=True, eq=False)
class Aim:
    """The end that a sketch describes, in D dimensions."""

    mean: Floats
    """Goal of the centre of mass (D,) [m]."""
    root: Floats | None
    """Symmetric root (2, 2) of the covariance of the particles in the front view [m], which an arrow leaves
    open: None. No sketch says how far the fluid extends in depth."""
    seconds: float
    """Time until then [s]."""

    @property
    def frame(self) -> Floats:
        """Matrix (D, D) from the aim's own coordinates, whose origin is `mean`, to metres.

        A unit in depth is the geometric mean of those in the front view: a scale, not a wish.
        """
        dim = len(self.mean)
        if self.root is None:
            return _ARROW_SCALE * np.eye(dim)
        frame = np.sqrt(max(float(np.linalg.det(self.root)), 1e-12)) * np.eye(dim)
        frame[:2, :2] = self.root
        return np.asarray(frame)

    def on_plane(self, plane: tuple[int, int]) -> Floats:
        """Return the matrix (2, 2) from own coordinates to metres on a plane."""
        axes = list(plane)
        if max(axes) < 2:
            return np.asarray(self.frame[np.ix_(axes, axes)])
        return np.asarray(np.diag(np.linalg.norm(self.frame[axes], axis=1)))

    def to_own(self, x: Floats) -> Floats:
        """Return points (..., D) [m] in the aim's own coordinates [-]."""
        return np.asarray((x - self.mean) @ np.linalg.inv(self.frame).T)

    def to_metres(self, own: Floats) -> Floats:
        """Return points (..., D) in the aim's own coordinates in metres."""
        return np.asarray(self.mean + own @ self.frame.T)


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of a transport network for B states with P particles each; float32."""

    grid: Floats32
    """(B, K * C, `CELLS`, `CELLS`): C `channels` of each of the K planes, rows along its vertical axis."""
    numbers: Floats32
    """(B, `numbers`)."""
    particles: Floats32
    """(B, P, `of_particle`)."""
    places: Floats32
    """Positions (B, P, D) between the walls, from -1 to 1."""


def distances(room: Room) -> Floats | None:
    """Return the distances of `State` for a room; None without obstacles."""
    if not room.scene.obstacles:
        return None
    cells = (np.arange(CELLS) + 0.5) / CELLS
    along = [lower + cells * (upper - lower) for lower, upper in zip(room.lower, room.upper, strict=True)]
    points = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1)
    return room.distance(points.reshape(-1, len(along))).reshape(points.shape[:-1])


def inputs(
    states: Sequence[State],
    aims: Sequence[Aim],
    chosen: Sequence[npt.NDArray[np.int64] | None],
    *,
    obstacles: bool,
) -> Inputs:
    """Return the inputs for some states of one dimension, one aim each.

    Parameters
    ----------
    states : sequence of State, of length B
    aims : sequence of Aim, of length B
    chosen : sequence of int64 (P,) or None, of length B
        Particles whose ends are wanted; None for all. P must be the same for all states.
    obstacles : bool
        Whether the network sees obstacles.
    """
    each = [_inputs(*one, obstacles=obstacles) for one in zip(states, aims, chosen, strict=True)]
    return Inputs(*(np.stack(column).astype(np.float32) for column in zip(*each, strict=True)))


def unit_places(x: Floats, lower: Floats, upper: Floats) -> Floats:
    """Return points (N, D) [m] as places between the walls, from -1 to 1."""
    return np.asarray((x - lower) / (upper - lower) * 2 - 1)


def _inputs(
    state: State, aim: Aim, chosen: npt.NDArray[np.int64] | None, *, obstacles: bool
) -> tuple[Floats, Floats, Floats, Floats]:
    dim = state.dim
    seen = [raster(state, plane) for plane in PLANES[dim]]
    planes = [_plane(state, aim, plane, one) for plane, one in zip(PLANES[dim], seen, strict=True)]
    if obstacles:
        planes = [
            np.concatenate([one, _solids(state, plane)])
            for plane, one in zip(PLANES[dim], planes, strict=True)
        ]
    grid = np.concatenate(planes)
    mean, covariance = moments(state.x, state.weight)
    middle = (state.lower + state.upper) / 2
    root = np.zeros((2, 2)) if aim.root is None else aim.root
    whole = np.concatenate(
        [
            [aim.root is None, state.weight @ state.sand, aim.seconds / _SECONDS - 1],
            (aim.mean - mean) / SCALE,
            root[np.triu_indices(2)] / SCALE,
            (mean - middle) / SCALE,
            4 * covariance[np.triu_indices(dim)] / SCALE**2,
            [_MUCH[dim] * len(state.x) * state.particle_volume],
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
            np.clip(aim.to_own(x) / 2, -_FARTHEST[dim], _FARTHEST[dim]),
            np.clip(aim.to_own(flight) / 4, -2, 2),
            v / 2,
            # The axes of the front view are those of space, in the same order.
            v - _sampled(seen[0].velocity, places[:, :2]),
            (x - middle) / (2 * SCALE),
            (x - mean) / SCALE,
            state.sand[every, None],
        ],
        axis=1,
    )
    return grid, whole, particles, places


@dataclass(frozen=True, eq=False)
class Raster:
    """A state on the C x C cells of a plane, rows along its vertical axis."""

    fill: Floats
    """Volume of the particles over that of the cell's column, times 8 in 3D (C, C) [-]."""
    velocity: Floats
    """Mean velocity (D, C, C) [m/s], 0 where there is nothing: along the plane's axes, then in depth."""
    deviation: Floats
    """Root mean square distance of the particles' velocities from the mean (C, C) [m/s]."""
    depth: Floats
    """Mean and standard deviation of the depth (2, C, C) [m], 0 where there is nothing; (0, C, C) in 2D."""
    sand: Floats
    """The part of `fill` that is sand (C, C) [-]."""


def raster(state: State, plane: tuple[int, int]) -> Raster:
    """Return a state as it is seen on a plane."""
    dim, axes = state.dim, list(plane)
    places = unit_places(state.x, state.lower, state.upper)
    nodes, weights = _corners(places[:, axes])
    shape = (CELLS, CELLS)

    def summed(values: Floats) -> Floats:
        found = np.bincount(nodes.ravel(), (weights * values[:, None]).ravel(), CELLS**2)
        return found.astype(np.float64).reshape(shape)

    mass = summed(np.ones(len(state.x)))
    share = _THICK[dim] * state.particle_volume / (np.prod(state.upper - state.lower) / CELLS**2)
    there = mass > 1e-3
    divisor = np.where(there, mass, 1.0)

    def mean(values: Floats) -> Floats:
        return summed(values) / divisor * there

    across = [axis for axis in range(dim) if axis not in plane]
    velocity = np.stack([mean(state.v[:, axis]) for axis in (*axes, *across)])
    square = mean((state.v**2).sum(axis=1))
    away = state.x - (state.lower + state.upper) / 2
    depth = [(mean(away[:, axis]), mean(away[:, axis] ** 2)) for axis in across]
    return Raster(
        fill=mass * share,
        velocity=velocity,
        deviation=np.sqrt(np.maximum(square - (velocity**2).sum(axis=0), 0.0)),
        depth=np.array([(one, np.sqrt(np.maximum(two - one**2, 0.0))) for one, two in depth]).reshape(
            -1, *shape
        ),
        sand=summed(state.sand.astype(np.float64)) * share,
    )


def _plane(state: State, aim: Aim, plane: tuple[int, int], seen: Raster) -> Floats:
    """Return the channels (C, `CELLS`, `CELLS`) of a plane: the state, and the aim as it is seen there."""
    axes = list(plane)
    cells = (np.arange(CELLS) + 0.5) / CELLS
    at = np.stack(np.meshgrid(cells, cells), axis=-1)
    x = state.lower[axes] + at * (state.upper - state.lower)[axes]
    own = (x - aim.mean[axes]) @ np.linalg.inv(aim.on_plane(plane)).T
    level = np.zeros((CELLS, CELLS)) if aim.root is None else np.exp(-(own**2).sum(axis=-1) / 4)
    return np.concatenate(
        [
            seen.fill[None],
            seen.velocity / 2,
            seen.deviation[None],
            seen.depth,
            seen.sand[None],
            (at - 0.5).transpose(2, 0, 1),
            level[None],
            np.clip(own / 4, -2, 2).transpose(2, 0, 1),
        ]
    )


def _solids(state: State, plane: tuple[int, int]) -> Floats:
    """Return what obstacles are on a plane (2, `CELLS`, `CELLS`).

    The first channel is the share of a cell's column that they take. The second is how near the nearest one
    is: 1 at its surface, 0 from `SCALE` on.
    """
    if state.distance is None:
        return np.zeros((2, CELLS, CELLS))
    side = (state.upper - state.lower).mean() / CELLS
    across = tuple(axis for axis in range(state.dim) if axis not in plane)
    order = (plane[1], plane[0], *across)  # rows along the vertical axis
    away = state.distance.transpose(order).reshape(CELLS, CELLS, -1)
    taken = np.clip(0.5 - away / side, 0.0, 1.0).mean(axis=-1)
    near = np.clip(1 - away.min(axis=-1) / SCALE, 0.0, 1.0)
    return np.stack([taken, near])


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

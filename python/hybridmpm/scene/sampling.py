"""From bodies to particles: one particle in each cell of a fine lattice, jittered.

Each body has a lattice of its own, which fits its bounds: a whole number of sites along each axis, about
`Scene.spacing` apart. Elastic balls have rings or shells around their centre in its place, since a rough one
does not roll. A site belongs to the first body that contains it, and sites inside an obstacle stay
empty. The particles of a body share its volume, less what earlier bodies and obstacles take of it. So a body
has the mass of its shape wherever it lies.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from hybridmpm import _core
from hybridmpm.errors import SceneError
from hybridmpm.scene.bodies import Ball, Body
from hybridmpm.scene.fields import Points
from hybridmpm.scene.materials import Elastic, Material
from hybridmpm.scene.obstacles import Obstacle
from hybridmpm.scene.rigid import RigidBody
from hybridmpm.scene.walls import Walls

JITTER = 0.25
"""Largest offset of a particle from its site along an axis [distances of sites].

So two particles of a body are never closer than half that distance.
"""

_CLEARANCE = 1e-3
"""Smallest distance of a particle from the walls [spacings], more than rounding to float32 can move it."""

_SITES_AT_ONCE = 100_000
"""Number of sites between two checks of `max_particles`, so that a scene that is too large fails early."""

_PARTS = 4
_FEWEST_PARTS = {2: 64, 3: 24}
"""Parts of a site along each axis, and the fewest of a body, to measure what others leave of it."""


_Solid = _core.Obstacle | _core.RigidBody


class Fillable(Protocol):
    """The part of a scene that sampling needs."""

    @property
    def dim(self) -> int:
        """Dimension D, 2 or 3."""

    @property
    def spacing(self) -> float:
        """Mean distance of neighbouring particles [m]."""

    @property
    def bodies(self) -> Sequence[Body]:
        """Bodies to fill, in this order."""

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """Obstacles, which hold no particles."""

    @property
    def rigid(self) -> Sequence[RigidBody]:
        """Rigid bodies, which hold no particles."""

    @property
    def walls(self) -> Walls:
        """Walls of the box that contains all particles."""

    @property
    def materials(self) -> Sequence[Material]:
        """Distinct materials of the scene, those of the bodies among them."""

    @property
    def max_particles(self) -> int:
        """Largest number of particles that the scene may have."""


@dataclass(frozen=True, kw_only=True)
class Particles:
    """Initial state of the N particles of a scene, body by body."""

    x: npt.NDArray[np.float32]
    """Positions (N, D) [m], strictly inside their bodies and the walls."""
    v: npt.NDArray[np.float32]
    """Velocities (N, D) [m/s]."""
    material: npt.NDArray[np.uint8]
    """Index (N,) of each particle's material in `Scene.materials`."""
    types: npt.NDArray[np.uint8]
    """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid."""
    body: npt.NDArray[np.int32]
    """Index (N,) of each particle's body in `Scene.bodies`."""
    mass: npt.NDArray[np.float32]
    """Masses (N,) [kg]; in 2D those of a slice one metre deep."""
    volume: npt.NDArray[np.float32]
    """Rest volumes (N,) [m^D], equal within a body."""


def sample(scene: Fillable) -> Particles:
    """Fill the bodies of `scene`; the same scene always gives the same particles.

    Raises
    ------
    FrameCancelledError
        A `CancelFlag` has ended the work.
    SceneError
        A body has room for no particle, or the bodies need more than `scene.max_particles`.
    """
    positions: list[npt.NDArray[np.float32]] = []
    volumes: list[float] = []
    solids: list[_Solid] = [part.to_native() for part in scene.obstacles]
    rigid = [(body.to_native(), *body.bounds) for body in scene.rigid]
    bounds = np.array([body.bounds for body in scene.bodies]).reshape(-1, 2, scene.dim)
    for index, body in enumerate(scene.bodies):
        lattice = _Lattice.of(scene, index, solids, rigid, bounds)
        needed = sum(map(len, positions))
        if isinstance(body, Ball) and isinstance(body.material, Elastic):
            x = _on_rings(scene, lattice, body, needed)
        else:
            x = _jittered(lattice, _free_sites(scene, lattice, needed), body.seed)
        if len(x) == 0:
            text = (
                "has room for no particle: it must hold a point of its lattice of spacing "
                f"{scene.spacing:.3g} m outside obstacles and earlier bodies"
            )
            raise SceneError.of([(f"bodies[{index}]", text)])
        positions.append(x)
        volumes.append(_free_volume(lattice, len(x)) / len(x))
    return _particles(scene, positions, volumes)


def _particles(scene: Fillable, positions: list[npt.NDArray[np.float32]], volumes: list[float]) -> Particles:
    counts = [len(x) for x in positions]
    materials = scene.materials
    still = (0.0,) * scene.dim
    masses = [body.material.density * volume for body, volume in zip(scene.bodies, volumes, strict=True)]

    def each(values: list[float] | list[int] | list[tuple[float, ...]], dtype: type) -> npt.NDArray[Any]:
        return np.repeat(np.array(values, dtype=dtype), counts, axis=0)

    return Particles(
        x=np.concatenate([np.empty((0, scene.dim), dtype=np.float32), *positions]),
        v=each([body.velocity or still for body in scene.bodies], np.float32).reshape(-1, scene.dim),
        material=each([materials.index(body.material) for body in scene.bodies], np.uint8),
        types=each([body.material.type_id for body in scene.bodies], np.uint8),
        body=each(list(range(len(counts))), np.int32),
        mass=each(masses, np.float32),
        volume=each(volumes, np.float32),
    )


@dataclass(frozen=True)
class _Lattice:
    """Sites of a body, and what takes some of them."""

    body: Body
    lower: Points
    """Corner of the first site (D,) [m]."""
    step: Points
    """Distances of sites (D,) [m]."""
    count: npt.NDArray[np.int64]
    """Numbers of sites (D,)."""
    walls: tuple[Points, Points]
    """Corners (D,) [m] of the box that contains all particles."""
    solids: list[_Solid]
    """Obstacles and rigid bodies that may reach into the body."""
    reach: float
    """Distance from solids up to which it matters how far they are [m]."""
    earlier: list[Body]
    """Bodies that come before it and may reach into it."""

    @classmethod
    def of(
        cls,
        scene: Fillable,
        index: int,
        solids: list[_Solid],
        rigid: list[tuple[_core.RigidBody, Points, Points]],
        bounds: npt.NDArray[np.float64],
    ) -> Self:
        """Return the lattice of the body with this index.

        Given are all obstacles, all rigid bodies with their bounds, and the bounds (n, 2, D) of all bodies.
        """
        body = scene.bodies[index]
        lower, upper = bounds[index]
        beside = (bounds[:index, 0] < upper).all(axis=1) & (bounds[:index, 1] > lower).all(axis=1)
        count = np.maximum(1, np.rint((upper - lower) / scene.spacing)).astype(np.int64)
        gap = _CLEARANCE * scene.spacing
        middle, reach = _rounded((lower + upper)[None] / 2), np.linalg.norm(upper - lower) / 2 + gap
        step = (upper - lower) / count
        solids = [solid for solid in solids if solid.signed_distance(middle)[0] <= reach]
        for solid, low, high in rigid:
            if (low < upper + step).all() and (high > lower - step).all():
                solids.append(solid)
        return cls(
            body=body,
            lower=lower,
            step=step,
            count=count,
            walls=(np.array(scene.walls.lower) + gap, np.array(scene.walls.upper) - gap),
            solids=solids,
            reach=2 * scene.spacing,
            earlier=[other for other, near in zip(scene.bodies, beside, strict=False) if near],
        )

    def blocks(self) -> Iterator[npt.NDArray[np.int64]]:
        """Yield the indices (n, D) of all sites, in slabs that bound the memory used."""
        slab = max(1, _SITES_AT_ONCE // int(np.prod(self.count[1:])))
        for start in range(0, int(self.count[0]), slab):
            _core.raise_if_cancelled()
            axes = [np.arange(start, min(start + slab, int(self.count[0])))]
            axes += [np.arange(count) for count in self.count[1:]]
            yield np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))

    def centers(self, sites: npt.NDArray[np.int64]) -> Points:
        """Return the middles (n, D) of sites [m]."""
        return self.lower + (sites + 0.5) * self.step

    def free(self, x: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """Whether points (n, D) lie in the body and in nothing else; shape (n,)."""
        exact = x.astype(np.float64)
        free = self.body.contains(exact) & (x > self.walls[0]).all(axis=1) & (x < self.walls[1]).all(axis=1)
        for other in self.earlier:
            _core.raise_if_cancelled()
            free &= ~other.contains(exact)
        for solid in self.solids:
            _core.raise_if_cancelled()
            free &= solid.signed_distance(x, within=self.reach) > 0
        return np.asarray(free)

    def may_be_cut(self, sites: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """Whether an obstacle or an earlier body may take a part of sites (n, D); shape (n,)."""
        x = self.centers(sites)
        cut = np.zeros(len(x), dtype=bool)
        for solid in self.solids:
            _core.raise_if_cancelled()
            distance = solid.signed_distance(_rounded(x), within=self.reach)
            cut |= distance < 0.51 * np.linalg.norm(self.step)
        for other in self.earlier:
            _core.raise_if_cancelled()
            lower, upper = other.bounds
            cut |= ((x > lower - self.step) & (x < upper + self.step)).all(axis=1)
        return cut


def _free_sites(scene: Fillable, lattice: _Lattice, needed: int) -> npt.NDArray[np.int64]:
    """Return the indices (n, D) of the free sites of a body; earlier bodies have `needed` particles.

    Raises
    ------
    SceneError
        All are more than `scene.max_particles`.
    """
    found = []
    for sites in lattice.blocks():
        found.append(sites[lattice.free(_rounded(lattice.centers(sites)))])
        needed += len(found[-1])
        _check_count(scene, needed)
    return np.concatenate(found)


def _on_rings(scene: Fillable, lattice: _Lattice, ball: Ball, needed: int) -> npt.NDArray[np.float32]:
    """Return the free positions (n, D) [m] of a ball, on rings (2D) or shells (3D) that are turned at random.

    The outermost one lies half a distance of rings below the surface.

    Raises
    ------
    SceneError
        Earlier bodies have `needed` particles, and all are more than `scene.max_particles`.
    """
    rng = np.random.default_rng(ball.seed)
    rings = max(1, round(ball.radius / scene.spacing))
    step, flat = ball.radius / rings, len(ball.center) == 2
    found = []
    for k in range(rings):
        _core.raise_if_cancelled()
        # As many as the area or the volume between two rings has sites.
        part = np.pi * (2 * k + 1) if flat else 4 * np.pi * ((k + 0.5) ** 2 + 1 / 12)
        count = max(1, round(part))
        turn = 2 * np.pi * rng.random()
        if flat:
            angle = turn + 2 * np.pi / count * np.arange(count)
            directions = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        else:
            # A spiral by the golden angle.
            angle = turn + np.pi * (3 - np.sqrt(5)) * np.arange(count)
            up = 1 - (2 * np.arange(count) + 1) / count
            across = np.sqrt(1 - up**2)
            directions = np.stack([across * np.cos(angle), up, across * np.sin(angle)], axis=-1)
        x = _rounded(np.array(ball.center) + (k + 0.5) * step * directions)
        found.append(x[lattice.free(x)])
        needed += len(found[-1])
        _check_count(scene, needed)
    return np.concatenate(found)


def _check_count(scene: Fillable, needed: int) -> None:
    if needed > scene.max_particles:
        text = f"need {needed} or more particles, allowed are [1, {scene.max_particles}] (max_particles)"
        raise SceneError.of([("bodies", text)])


def _free_volume(lattice: _Lattice, count: int) -> float:
    """Return the volume [m^D] that obstacles and earlier bodies leave of a body, for `count` particles."""
    measure = lattice.body.measure
    if not (lattice.solids or lattice.earlier):
        return measure
    parts = np.maximum(_PARTS, -(-_FEWEST_PARTS[len(lattice.count)] // lattice.count))
    cell = float(np.prod(lattice.step))
    corners = np.stack(np.meshgrid(*map(np.arange, parts), indexing="ij"), axis=-1).reshape(1, -1, len(parts))
    rng = np.random.default_rng(0)
    inside = free = 0
    for block in lattice.blocks():
        sites = block[lattice.may_be_cut(block)]
        for few in np.array_split(sites, -(-len(sites) * corners.shape[1] // _SITES_AT_ONCE) or 1):
            # A point at random in each part: surfaces along the axes would all miss by half a part.
            within = (corners + rng.random((len(few), *corners.shape[1:]))) / parts
            x = (lattice.lower + (few[:, None] + within) * lattice.step).reshape(-1, len(parts))
            inside += int(lattice.body.contains(x).sum())
            free += int(lattice.free(_rounded(x)).sum())
    part = cell / corners.shape[1]
    return max(max(measure - inside * part, 0.0) + free * part, count * part)


def _rounded(x: Points) -> npt.NDArray[np.float32]:
    """Return positions in the solver's precision; every test of containment is made on these."""
    return x.astype(np.float32)


def _jittered(lattice: _Lattice, sites: npt.NDArray[np.int64], seed: int) -> npt.NDArray[np.float32]:
    """Return positions (n, D) [m]: each site moved at random, or unmoved where it would leave the body."""
    rng = np.random.default_rng(seed)
    centers = lattice.centers(sites)
    moved = _rounded(centers + rng.uniform(-JITTER, JITTER, centers.shape) * lattice.step)
    return np.where(lattice.free(moved)[:, None], moved, _rounded(centers))

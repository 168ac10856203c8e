"""From bodies to particles: one particle in each cell of a fine lattice, jittered.

One lattice spans the whole world; its sites are `Scene.spacing` apart. A site belongs to the first body of
the scene that contains it, so that overlapping bodies never have two particles in one place. Sites inside an
obstacle stay empty.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import SceneError
from hybridmpm.scene.bodies import Body
from hybridmpm.scene.fields import Points
from hybridmpm.scene.materials import Material
from hybridmpm.scene.obstacles import Obstacle
from hybridmpm.scene.walls import Walls

JITTER = 0.25
"""Largest offset of a particle from its site along an axis [spacings].

So two particles are never closer than half a spacing.
"""

_CLEARANCE = 1e-3
"""Smallest distance of a particle from the walls [spacings], more than rounding to float32 can move it."""

_SITES_AT_ONCE = 100_000
"""Number of sites between two checks of `max_particles`, so that a scene that is too large fails early."""


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
    """DeepMind's particle types (N,): 5 water, 6 sand, 7 elastic (goop)."""
    body: npt.NDArray[np.int32]
    """Index (N,) of each particle's body in `Scene.bodies`."""
    mass: npt.NDArray[np.float32]
    """Masses (N,) [kg]; in 2D those of a slice one metre deep."""
    volume: npt.NDArray[np.float32]
    """Rest volumes spacing^D (N,) [m^D]."""


def sample(scene: Fillable) -> Particles:
    """Fill the bodies of `scene`; the same scene always gives the same particles.

    Raises
    ------
    SceneError
        A body has room for no particle, or the bodies need more than `scene.max_particles`.
    """
    positions: list[npt.NDArray[np.float32]] = []
    taken = np.empty(0, dtype=np.int64)
    for index, body in enumerate(scene.bodies):
        sites = _free_sites(scene, body, taken)
        if len(sites) == 0:
            text = (
                "has room for no particle: it must hold a point of the lattice of spacing "
                f"{scene.spacing:.3g} m outside obstacles and earlier bodies"
            )
            raise SceneError.of([(f"bodies[{index}]", text)])
        # Free sites are not among those taken, so that there is nothing to unite, which takes seconds.
        taken = np.concatenate([taken, _keys(scene, sites)])
        positions.append(_jittered(scene, body, sites))
    return _particles(scene, positions)


def _particles(scene: Fillable, positions: list[npt.NDArray[np.float32]]) -> Particles:
    counts = [len(x) for x in positions]
    materials = scene.materials
    still = (0.0,) * scene.dim
    volume = scene.spacing**scene.dim

    def each(values: list[float] | list[int] | list[tuple[float, ...]], dtype: type) -> npt.NDArray[Any]:
        return np.repeat(np.array(values, dtype=dtype), counts, axis=0)

    return Particles(
        x=np.concatenate([np.empty((0, scene.dim), dtype=np.float32), *positions]),
        v=each([body.velocity or still for body in scene.bodies], np.float32).reshape(-1, scene.dim),
        material=each([materials.index(body.material) for body in scene.bodies], np.uint8),
        types=each([body.material.type_id for body in scene.bodies], np.uint8),
        body=each(list(range(len(counts))), np.int32),
        mass=each([body.material.density * volume for body in scene.bodies], np.float32),
        volume=np.full(sum(counts), volume, dtype=np.float32),
    )


def _free_sites(scene: Fillable, body: Body, taken: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return the lattice indices (n, D) of the sites that are free for `body`.

    Parameters
    ----------
    scene, body
        The scene and the body to fill.
    taken : int64 (K,)
        Keys of the sites that earlier bodies have.

    Raises
    ------
    SceneError
        The free sites and the taken ones are more than `scene.max_particles`.
    """
    solids = [obstacle.to_native() for obstacle in scene.obstacles]
    free, needed = [], len(taken)
    for sites in _lattice_blocks(scene, body):
        centers = _rounded(_centers(scene, sites))
        keep = body.contains(centers.astype(np.float64)) & _clear_of_walls(scene, centers)
        sites, centers = sites[keep], centers[keep]  # noqa: PLW2901 - narrowed step by step
        for solid in solids:
            outside = solid.signed_distance(centers) > 0
            sites, centers = sites[outside], centers[outside]  # noqa: PLW2901
        sites = sites[~np.isin(_keys(scene, sites), taken)]  # noqa: PLW2901
        needed += len(sites)
        if needed > scene.max_particles:
            text = f"need {needed} or more particles, allowed are [1, {scene.max_particles}] (max_particles)"
            raise SceneError.of([("bodies", text)])
        free.append(sites)
    return np.concatenate(free)


def _lattice_blocks(scene: Fillable, body: Body) -> Iterator[npt.NDArray[np.int64]]:
    """Yield the lattice indices (n, D) of the bounding box of `body`, in slabs that bound the memory used."""
    lower, upper = body.bounds
    first = np.floor(lower / scene.spacing).astype(int)
    last = np.ceil(upper / scene.spacing).astype(int)
    slab = max(1, _SITES_AT_ONCE // int(np.prod(last[1:] - first[1:])))
    for start in range(int(first[0]), int(last[0]), slab):
        axes = [np.arange(start, min(start + slab, int(last[0])))]
        axes += [np.arange(a, b) for a, b in zip(first[1:], last[1:], strict=True)]
        yield np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, scene.dim)


def _centers(scene: Fillable, sites: npt.NDArray[np.int64]) -> Points:
    return (sites.astype(np.float64) + 0.5) * scene.spacing


def _rounded(x: Points) -> npt.NDArray[np.float32]:
    """Return positions in the solver's precision; every test of containment is made on these."""
    return x.astype(np.float32)


def _keys(scene: Fillable, sites: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return one number (n,) for each site, different for different sites."""
    extent = int(np.ceil(max(scene.walls.upper) / scene.spacing)) + 1
    return np.asarray(np.ravel_multi_index(tuple(sites.T), (extent,) * scene.dim), dtype=np.int64)


def _clear_of_walls(scene: Fillable, x: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    gap = _CLEARANCE * scene.spacing
    lower, upper = np.array(scene.walls.lower) + gap, np.array(scene.walls.upper) - gap
    return np.asarray(((x > lower) & (x < upper)).all(axis=1))


def _jittered(scene: Fillable, body: Body, sites: npt.NDArray[np.int64]) -> npt.NDArray[np.float32]:
    """Return positions (n, D) [m]: each site moved at random, or unmoved where it would leave the body."""
    rng = np.random.default_rng(body.seed)
    centers = _centers(scene, sites)
    moved = _rounded(centers + rng.uniform(-JITTER, JITTER, centers.shape) * scene.spacing)
    allowed = body.contains(moved.astype(np.float64)) & _clear_of_walls(scene, moved)
    for obstacle in scene.obstacles:
        allowed &= obstacle.to_native().signed_distance(moved) > 0
    return np.where(allowed[:, None], moved, _rounded(centers))

"""Random scenes: whatever a user may ask for keeps running, loses no particle, and keeps its bits.

A scene is a function of its seed alone. The default suite runs few and short ones; `make test-all` runs a
thousand of them for two thousand frames each. To look into one: `random_scene(seed).save("scene.yaml")`.
"""

import itertools
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import (
    Ball,
    BallObstacle,
    Box,
    BoxObstacle,
    Elastic,
    HalfSpaceObstacle,
    MpmSolver,
    Polygon,
    Sand,
    Scene,
    SceneError,
    SegmentObstacle,
    SimulationError,
    Walls,
    Water,
    _native,
)
from hybridmpm.cli.report import usable_cores

# Forces of some scenes tear soft bodies, which is no fault.
pytestmark = pytest.mark.filterwarnings("ignore::hybridmpm.TornBodyWarning")

Vector = npt.NDArray[np.float64]
Material = Water | Sand | Elastic

CONTACTS = {"separating": 0.7, "slip": 0.15, "sticky": 0.15}
FRAMES_PER_FORCE = 50
PARALLEL_FROM = 8192
"""Particles above which the solver hands work to threads."""


class Draw:
    """Draws the parts of the scene of one seed; lengths in metres."""

    def __init__(self, seed: list[int], most_particles: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.dim = int(self.rng.choice([2, 3], p=[0.65, 0.35]))
        self.resolution = int(self.rng.integers(20, 65) if self.dim == 2 else self.rng.integers(14, 29))
        self.most_particles = most_particles
        self.lower, self.upper = self.walls(), 1.0 - self.walls()
        self.room = self.upper - self.lower
        self.gravity = float(self.rng.choice([0.0, 9.81, self.rng.uniform(1, 30)], p=[0.1, 0.5, 0.4]))
        # Impacts near the speed of sound turn particles inside out, which is an error of its own.
        self.fastest = 4.0 + np.sqrt(2 * (self.gravity + push_size(seed[0])))

    def walls(self) -> Vector:
        """Half of all walls lie at the default place, the others anywhere."""
        at_default = self.rng.random(self.dim) < 0.5
        return np.where(at_default, 0.1, self.rng.uniform(0.0, 0.25, self.dim))

    def log_uniform(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def vector(self, length: float) -> tuple[float, ...]:
        v = self.rng.normal(size=self.dim)
        return tuple((length * v / np.linalg.norm(v)).tolist())

    def place(self, size: Vector | float) -> Vector:
        """Lower corner of something of this size between the walls."""
        return self.lower + self.rng.uniform(0, 1, self.dim) * (self.room - size)

    def material(self) -> Material:
        density = self.log_uniform(300, 3000)
        stiffness = density * (self.fastest * self.log_uniform(1.5, 6)) ** 2
        common: dict[str, Any] = {"density": density, "wall_friction": self.rng.uniform(0, 1.2)}
        solid = {"youngs_modulus": stiffness, "poisson_ratio": self.rng.uniform(0, 0.4)}
        correction = bool(self.rng.random() < 0.8)
        kind = self.rng.integers(3)
        if kind == 0:
            tension = self.rng.uniform(0, 1)
            return Water(bulk_modulus=stiffness, tension=tension, volume_correction=correction, **common)
        if kind == 1:
            angle = self.rng.uniform(5, 60)
            return Sand(friction_angle=angle, volume_correction=correction, **common, **solid)
        return Elastic(**common, **solid)

    def body(self, material: Material, share: float) -> Ball | Box | Polygon:
        """Draw a body whose bounding box fills a share of the room."""
        sides = self.rng.uniform(0.5, 1.0, self.dim)
        size = self.room * np.minimum(sides * (share / sides.prod()) ** (1 / self.dim), 0.999)
        common: dict[str, Any] = {"material": material, "velocity": self.vector(self.rng.uniform(0, 4))}
        common["seed"] = int(self.rng.integers(1000))
        kind = self.rng.integers(5 - self.dim)
        if kind == 0:
            lower = self.place(size)
            return Box(lower=tuple(lower), upper=tuple(lower + size), **common)
        if kind == 1:
            radius = float(size.min() / 2)
            return Ball(center=tuple(self.place(2 * radius) + radius), radius=radius, **common)
        angles = np.sort(self.rng.uniform(0, 2 * np.pi, int(self.rng.integers(3, 8))))
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        corners = self.place(size) + size * (0.5 + 0.5 * ring)
        return Polygon(vertices=tuple(tuple(corner) for corner in corners.tolist()), **common)

    def obstacle(self) -> BallObstacle | BoxObstacle | HalfSpaceObstacle | SegmentObstacle:
        contact = str(self.rng.choice(list(CONTACTS), p=list(CONTACTS.values())))
        common: dict[str, Any] = {"contact": contact}
        if contact == "separating" and self.rng.random() < 0.5:
            common["friction"] = self.rng.uniform(0, 1.5)
        thickness = self.rng.uniform(2.0, 5.0) / self.resolution
        kind = self.rng.integers(4)
        if kind == 0:
            return BallObstacle(center=tuple(self.place(0.0)), radius=thickness, **common)
        if kind == 1:
            size = np.maximum(thickness, self.rng.uniform(0, 0.25, self.dim))
            lower = self.rng.uniform(0, 1 - size)
            return BoxObstacle(lower=tuple(lower), upper=tuple(lower + size), **common)
        if kind == 2:
            normal = self.vector(1.0)
            corner = np.where(np.array(normal) > 0, self.lower, self.upper)
            point = corner + self.rng.uniform(0, 0.3) * (0.5 * (self.lower + self.upper) - corner)
            return HalfSpaceObstacle(point=tuple(point), normal=normal, **common)
        ends = {"start": tuple(self.place(0.0)), "end": tuple(self.place(0.0))}
        return SegmentObstacle(thickness=thickness, **ends, **common)

    def scene(self) -> Scene:
        per_cell = int(self.rng.integers(2, 2**self.dim + 3))
        spots = float(self.room.prod()) * self.resolution**self.dim * per_cell
        fill = self.rng.uniform(0.2, 1.0) * min(self.most_particles / spots, 0.6)
        bodies = int(self.rng.integers(1, 5))
        materials = [self.material() for _ in range(int(self.rng.integers(1, 4)))]
        contact = str(self.rng.choice(list(CONTACTS), p=list(CONTACTS.values())))
        friction = self.rng.uniform(0, 1) if contact == "separating" and self.rng.random() < 0.4 else None
        return Scene(
            dim=self.dim,
            resolution=self.resolution,
            gravity=self.vector(self.gravity),
            walls=Walls(lower=tuple(self.lower), upper=tuple(self.upper), contact=contact, friction=friction),
            obstacles=tuple(self.obstacle() for _ in range(int(self.rng.integers(4)))),
            bodies=tuple(self.body(materials[i % len(materials)], fill / bodies) for i in range(bodies)),
            particles_per_cell=per_cell,
        )


def random_scene(seed: int, most_particles: int = 800, least_particles: int = 1) -> Scene:
    """Draw the scene of a seed; one whose bodies lie within obstacles, or are too small, is drawn again."""
    for attempt in itertools.count():
        try:
            scene = Draw([seed, attempt], most_particles).scene()
            if len(scene.sample().x) >= least_particles:
                return scene
        except SceneError:
            continue
    raise AssertionError


def push_size(seed: int) -> float:
    """Size of the external accelerations in the scene of a seed [m/s^2]."""
    return float(np.random.default_rng([seed, 1]).choice([0.0, 5.0, 30.0], p=[0.4, 0.3, 0.3]))


def push(seed: int, solver: MpmSolver) -> npt.NDArray[np.float32] | None:
    """External accelerations at the present frame, new ones every FRAMES_PER_FORCE frames."""
    size = push_size(seed)
    if size == 0:
        return None
    rng = np.random.default_rng([seed, 2, solver.frame // FRAMES_PER_FORCE])
    common, own = rng.normal(size=solver.dim), rng.normal(size=(solver.particle_count, solver.dim))
    field = common + 0.3 * own
    return (size * field / np.linalg.norm(field, axis=1).max()).astype(np.float32)


def advance(seed: int, solver: MpmSolver, frames: int) -> None:
    """Advance to a frame under the forces of the seed, and look for particles that are not sound."""
    dx, walls = solver.scene.dx, solver.scene.walls
    lower, upper = np.maximum(np.subtract(walls.lower, dx), 0), np.minimum(np.add(walls.upper, dx), 1)
    while solver.frame < frames:
        count = min(frames - solver.frame, FRAMES_PER_FORCE - solver.frame % FRAMES_PER_FORCE)
        solver.advance(count, push(seed, solver))
        x = solver.positions
        assert ((x >= lower) & (x <= upper)).all(), f"a particle escaped by frame {solver.frame}"
        assert np.isfinite(solver.velocities).all()
        assert (solver.volume_ratio > 0).all()


def fault(seed: int, frames: int, most_particles: int) -> str | None:
    """Run the scene of a seed and return what went wrong, if anything."""
    try:
        solver = MpmSolver(random_scene(seed, most_particles))
        advance(seed, solver, frames)
    except (AssertionError, SimulationError) as error:
        return f"seed {seed}: {type(error).__name__}: {error}"
    return None if solver.frame == frames else f"seed {seed}: stopped at frame {solver.frame}"


def assert_all_survive(seeds: range, frames: int, most_particles: int) -> None:
    # The solver computes with the GIL released, so threads share the cores as processes would.
    with ThreadPoolExecutor(usable_cores()) as pool:
        found = list(pool.map(lambda seed: fault(seed, frames, most_particles), seeds))
    faults = [text for text in found if text]
    assert not faults, "\n".join(faults)


def assert_bits_survive(seed: int, frames: int, **size: int) -> None:
    """Threads, a snapshot at a random cut, and a batch: none of them changes a bit."""
    scene = random_scene(seed, **size)
    whole = MpmSolver(scene)
    advance(seed, whole, frames)
    cut = int(np.random.default_rng([seed, 3]).integers(1, frames))
    threads = (1, 2, 4)
    for before, after in ((threads[seed % 3], threads[(seed + 1) % 3]), (1, 4)):
        first, second = MpmSolver(scene, threads=before), MpmSolver(scene, threads=after)
        advance(seed, first, cut)
        second.restore(first.snapshot())
        advance(seed, second, frames)
        assert second.snapshot() == whole.snapshot(), f"seed {seed} cut at {cut}, threads {before}, {after}"


def assert_batch_is_single(seeds: range, frames: int, most_particles: int) -> None:
    together = [MpmSolver(random_scene(seed, most_particles)) for seed in seeds]
    alone = [solver.copy() for solver in together]
    _native.advance_all([solver._solver for solver in together], frames)
    for seed, one, other in zip(seeds, together, alone, strict=True):
        other.advance(frames)
        assert one.snapshot() == other.snapshot(), f"seed {seed}"


@pytest.mark.parametrize("first", range(0, 30, 10))
def test_random_scenes_run(first: int) -> None:
    assert_all_survive(range(first, first + 10), frames=400, most_particles=800)


@pytest.mark.parametrize("seed", range(6))
def test_bits_of_small_scenes(seed: int) -> None:
    assert_bits_survive(seed, frames=60, most_particles=600)


@pytest.mark.parametrize("seed", [0, 1])
def test_bits_of_scenes_that_threads_share(seed: int) -> None:
    assert_bits_survive(seed, frames=12, most_particles=30_000, least_particles=PARALLEL_FROM)


def test_bits_of_a_batch() -> None:
    assert_batch_is_single(range(20), frames=60, most_particles=600)


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("first", range(0, 1000, 50))
def test_a_thousand_random_scenes_run(first: int) -> None:
    assert_all_survive(range(first, first + 50), frames=2000, most_particles=1500)


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("first", range(0, 100, 10))
def test_bits_of_many_scenes(first: int) -> None:
    for seed in range(first, first + 10):
        assert_bits_survive(seed, frames=400, most_particles=1000)
    assert_bits_survive(first, frames=100, most_particles=30_000, least_particles=PARALLEL_FROM)
    assert_batch_is_single(range(first, first + 10), frames=400, most_particles=1000)

"""Merged particles keep what they must, run stably, and carry all particles along."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hybridmpm import Box, ConfigError, MpmSolver, Particles, Scene, Walls, downsampling, metrics, scenarios
from hybridmpm.recording import Recording, record

RATIOS = [1 / 1.75, 1 / 4, 1 / 8, 1 / 16]


def moving(scene: Scene) -> Particles:
    """Return the particles of a scene, each with its own velocity, so that momentum is no foregone thing."""
    particles = scene.sample()
    v = np.random.default_rng(0).normal(1.0, 2.0, particles.x.shape).astype(np.float32)
    return dataclasses.replace(particles, v=v)


@pytest.mark.parametrize("r_p", RATIOS)
@pytest.mark.parametrize("name", ["water_2d", "sand_ramps_2d", "water_sand_2d", "sand_3d"])
def test_each_material_keeps_mass_momentum_and_centroid(name: str, r_p: float) -> None:
    before = moving(scenarios.get(name, 7))
    after = downsampling.merge(before, r_p)
    assert len(after.x) == round(r_p * len(before.x))
    for kind in np.unique(before.material):
        totals = []
        for one in (before, after):
            chosen = one.material == kind
            m = one.mass[chosen].astype(np.float64)
            x, v = one.x[chosen], one.v[chosen]
            totals.append([m.sum(), *(m @ v), *(m @ x / m.sum()), one.volume[chosen].sum(dtype=np.float64)])
        np.testing.assert_allclose(totals[1], totals[0], rtol=1e-6)


@pytest.mark.parametrize("r_p", RATIOS)
def test_bodies_stay_apart_and_sizes_even(r_p: float) -> None:
    scene = scenarios.water_2d(11)
    before, after = scene.sample(), downsampling.merge(scene.sample(), r_p)
    for index, body in enumerate(scene.bodies):
        mine = after.body == index
        lower, upper = body.bounds
        assert ((after.x[mine] > lower) & (after.x[mine] < upper)).all()
        sizes = np.rint(after.mass[mine] / before.mass[0])
        assert sizes.max() - sizes.min() <= 1
        assert mine.sum() == pytest.approx(r_p * (before.body == index).sum(), abs=1)
    np.testing.assert_allclose(after.mass / after.volume, 1000, rtol=1e-6)


def test_the_seed_decides() -> None:
    particles = scenarios.sand_2d(3).sample()
    one = downsampling.merge(particles, 0.25, seed=4)
    np.testing.assert_array_equal(one.x, downsampling.merge(particles, 0.25, seed=4).x)
    assert (one.x != downsampling.merge(particles, 0.25, seed=5).x).any()


def test_all_particles_are_the_particles() -> None:
    particles = scenarios.water_2d(0).sample()
    assert downsampling.merge(particles, 1) is particles


def test_every_body_keeps_a_particle() -> None:
    bodies = tuple(
        Box(material="water", lower=(0.2 + 0.2 * i, 0.2), upper=(0.22 + 0.2 * i, 0.22)) for i in range(3)
    )
    after = downsampling.merge(Scene(dim=2, bodies=bodies).sample(), 0.001)
    assert after.body.tolist() == [0, 1, 2]


@pytest.mark.parametrize("r_p", [0, -0.5, 1.01, float("nan"), "1/4", None])
def test_bad_ratios(r_p: float, drop: Scene) -> None:
    with pytest.raises(ConfigError, match=r"r_p must be in \(0, 1\]"):
        downsampling.merge(drop.sample(), r_p)
    with pytest.raises(ConfigError, match=r"r_p must be in \(0, 1\]"):
        MpmSolver(drop, r_p=r_p)


@pytest.mark.parametrize(
    ("dim", "r_p", "resolution"),
    [
        (2, 1, 128),
        (2, 1 / 1.75, 128),
        (2, 1 / 2, 128),
        (2, 1 / 4, 90),
        (2, 1 / 8, 64),
        (2, 1 / 16, 45),
        (3, 1 / 4, 64),
        (3, 1 / 16, 40),
    ],
)
def test_coarse_grids_hold_two_particles_a_cell(dim: int, r_p: float, resolution: int) -> None:
    scene = scenarios.get(f"water_{dim}d", 1)
    assert downsampling.coarse_resolution(scene, r_p) == resolution
    solver = MpmSolver(scene, r_p=r_p)
    assert solver.resolution == resolution
    volume = sum(body.measure for body in scene.bodies)
    assert solver.particle_count / (volume * resolution**dim) > 1.95


def test_a_scene_with_one_particle_a_cell_keeps_its_grid() -> None:
    box = Box(material="water", lower=(0.2, 0.2), upper=(0.5, 0.5))
    assert MpmSolver(Scene(dim=2, particles_per_cell=1, bodies=(box,))).resolution == 128


def test_ratios_too_small_for_the_walls_are_refused() -> None:
    box = Box(material="water", lower=(0.4, 0.2), upper=(0.6, 0.4))
    scene = Scene(dim=2, bodies=(box,), walls=Walls(lower=(0.375, 0.1), upper=(0.625, 0.9)))
    # 16 cells per metre are 4 between the walls.
    least = 0.5 * (16 / 128) ** 2
    assert downsampling.coarse_resolution(scene, 1.001 * least) == 16
    with pytest.raises(ConfigError, match=r"r_p must be at least 0\.0078 in .* grid needs 16 cells"):
        MpmSolver(scene, r_p=0.9 * least)


def test_a_file_of_fewer_particles_goes_on_with_the_same_bits(tmp_path: Path) -> None:
    whole = MpmSolver(scenarios.water_sand_2d(2), r_p=0.25)
    whole.advance(20)
    whole.save(tmp_path / "state")
    whole.advance(5)
    again = MpmSolver.load(tmp_path / "state")
    again.advance(5)
    assert again.snapshot() == whole.snapshot()
    assert (again.resolution, again.particle_count) == (whole.resolution, whole.particle_count)


@pytest.mark.parametrize("r_p", RATIOS)
@pytest.mark.parametrize("name", ["water_2d", "water_sand_2d", "sand_3d"])
def test_fewer_particles_move_as_all_do(name: str, r_p: float) -> None:
    """The centre of mass follows that of all particles to a cell of the coarse grid over 60 frames."""
    scene = scenarios.get(name, 1_100_000)
    true, run = (record(MpmSolver(scene, r_p=ratio), 60, every=20) for ratio in (1, r_p))
    apart = metrics.centroid_error(run.positions, run.mass, true.positions, true.mass)
    assert apart.max() < 1 / downsampling.coarse_resolution(scene, r_p)
    assert metrics.penetration_count(scene, run.positions).max() == 0


def test_strided() -> None:
    recording = record(MpmSolver(scenarios.water_2d(1), r_p=0.1), 7)
    twos = downsampling.strided(recording, 3)
    assert twos.frames.tolist() == [0, 3, 6]
    np.testing.assert_array_equal(twos.positions, recording.positions[[0, 3, 6]])
    np.testing.assert_array_equal(twos.velocities, recording.velocities[[0, 3, 6]])
    with pytest.raises(ConfigError, match=r"r_t must be in \[1, 8\], got 9"):
        downsampling.strided(recording, 9)


def prescribed(scene: Scene, positions: np.ndarray) -> Recording:
    """Return a recording of particles that were at these positions (F, N, D)."""
    positions = positions.astype(np.float32)
    count = positions.shape[1]
    return Recording(
        scene=scene,
        ids=np.arange(count, dtype=np.uint64),
        types=np.full(count, 5, dtype=np.uint8),
        mass=np.ones(count, dtype=np.float32),
        frames=np.arange(len(positions)),
        positions=positions,
        velocities=np.zeros_like(positions),
    )


def test_a_translation_carries_all_particles_exactly(drop: Scene) -> None:
    fine = drop.sample().x
    coarse = downsampling.merge(drop.sample(), 0.25).x
    steps = np.cumsum([[0.0, 0.0], [0.003, 0.0], [0.002, -0.004], [0.0, 0.01]], axis=0)
    path = downsampling.upsample(prescribed(drop, coarse + steps[:, None]), fine, resolution=45)
    assert path.shape == (4, len(fine), 2)
    np.testing.assert_allclose(path, fine + steps[:, None], atol=1e-6)


def test_particles_that_nothing_is_near_fly_and_walls_hold_them(drop: Scene) -> None:
    coarse = np.broadcast_to(drop.sample().x, (5, *drop.sample().x.shape))
    path = downsampling.upsample(prescribed(drop, coarse), [[0.2, 0.8], [0.8, 0.1]], resolution=64)
    # From rest, with the velocity at the end of each frame: g dt^2 (1 + 2 + 3 + 4).
    assert path[-1, 0] == pytest.approx([0.2, 0.8 - 10 * 9.81 * 0.0025**2], abs=1e-6)
    assert path[-1, 1] == pytest.approx([0.8, 0.1])


def test_carrying_all_particles_comes_closer_to_the_truth() -> None:
    """At r_p = 1/8 the merged particles alone leave holes in the grid of the truth, carried ones do not."""
    scene = scenarios.water_2d(1_100_001)
    true = record(MpmSolver(scene, substeps="reference"), 100)
    solver = MpmSolver(scene, r_p=1 / 8)
    run = record(solver, 100)
    path = downsampling.upsample(run, true.positions[0], resolution=solver.resolution)
    grids = [
        metrics.grid_mass(x[-1], mass, scene.resolution)
        for x, mass in ((path, true.mass), (run.positions, run.mass), (true.positions, true.mass))
    ]
    assert metrics.grid_rmse(grids[0], grids[2]) < 0.6 * metrics.grid_rmse(grids[1], grids[2])


def test_upsample_refuses(drop: Scene) -> None:
    recording = record(MpmSolver(drop), 1)
    with pytest.raises(ConfigError, match=r"x must have shape \(N, 2\), got \(1, 3\)"):
        downsampling.upsample(recording, [[0.5, 0.5, 0.5]], resolution=64)
    with pytest.raises(ConfigError, match="resolution must be in"):
        downsampling.upsample(recording, [[0.5, 0.5]], resolution=4)

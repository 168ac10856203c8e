"""Merged particles keep sums, run stably, and move as all particles do."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from hybridmpm import Box, ConfigError, MpmSolver, Particles, Scene, Walls, coarse, metrics, scenarios
from hybridmpm.recording import record

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
    after = coarse.merge(before, r_p)
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
    before, after = scene.sample(), coarse.merge(scene.sample(), r_p)
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
    one = coarse.merge(particles, 0.25, seed=4)
    np.testing.assert_array_equal(one.x, coarse.merge(particles, 0.25, seed=4).x)
    assert (one.x != coarse.merge(particles, 0.25, seed=5).x).any()


def test_all_particles_are_the_particles() -> None:
    particles = scenarios.water_2d(0).sample()
    assert coarse.merge(particles, 1) is particles


def test_every_body_keeps_a_particle() -> None:
    bodies = tuple(
        Box(material="water", lower=(0.2 + 0.2 * i, 0.2), upper=(0.22 + 0.2 * i, 0.22)) for i in range(3)
    )
    after = coarse.merge(Scene(dim=2, bodies=bodies).sample(), 0.001)
    assert after.body.tolist() == [0, 1, 2]


@pytest.mark.parametrize("r_p", [0, -0.5, 1.01, float("nan"), "1/4", None])
def test_bad_ratios(r_p: float, drop: Scene) -> None:
    with pytest.raises(ConfigError, match=r"r_p must be in \(0, 1\]"):
        coarse.merge(drop.sample(), r_p)
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
    assert coarse.coarse_resolution(scene, r_p) == resolution
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
    assert coarse.coarse_resolution(scene, 1.001 * least) == 16
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
    assert apart.max() < 1 / coarse.coarse_resolution(scene, r_p)
    assert metrics.penetration_count(scene, run.positions).max() == 0

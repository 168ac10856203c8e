"""Blow-ups: steps that are too long, particles alone, violent impacts, noise that grows."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import Ball, Box, Elastic, MpmSolver, Scene, SimulationError, StepSizeError, _native

Build = Callable[..., _native.Solver]

WATER = _native.Material.water(density=1000.0, bulk_modulus=277_778.0)
SAND = _native.Material.sand(density=1000.0, youngs_modulus=1e6, poisson_ratio=0.2, friction_angle=45.0)
ELASTIC = _native.Material.elastic(density=1000.0, youngs_modulus=3e5, poisson_ratio=0.2)
MATERIALS = {"water": WATER, "sand": SAND, "elastic": ELASTIC}


def block(lower: float, upper: float, resolution: int, dim: int = 2) -> npt.NDArray[np.float64]:
    """Positions of two particles per cell and axis from `lower` to `upper` along each axis."""
    axis = np.arange(lower + 0.25 / resolution, upper, 0.5 / resolution)
    return np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)


def energy(solver: MpmSolver | _native.Solver) -> float:
    totals = solver.diagnostics()
    return totals.kinetic_energy + totals.elastic_energy + totals.potential_energy


@pytest.mark.parametrize("material", ["water", "sand", "elastic"])
def test_steps_above_the_acoustic_limit_are_refused_and_fail_as_an_error(material: str) -> None:
    body = Box(material=material, lower=(0.3, 0.11), upper=(0.6, 0.4), velocity=(1.0, -2.0))
    scene = Scene(dim=2, resolution=64, frame_dt=0.005, bodies=(body,))
    with pytest.raises(StepSizeError, match="substeps"):
        MpmSolver(scene, substeps=4).advance()
    solver = MpmSolver(scene, substeps=4, allow_unstable=True)
    with pytest.raises(SimulationError, match="particle"):
        solver.advance(400)
    # Never a silent NaN: the state is that of the last good frame.
    assert np.isfinite(solver.positions).all()
    assert np.isfinite(solver.velocities).all()


def assert_bounded(build: Build, material: str, x: npt.NDArray[np.float64], ratio: float) -> None:
    """Take 10^4 steps of the default length; its energy gives a particle at most about the speed of sound."""
    dim, sound = x.shape[1], MATERIALS[material].sound_speed
    solver = build(
        x,
        0.0,
        MATERIALS[material],
        resolution=32,
        frame_dt=MATERIALS[material].default_cfl / 32 / MATERIALS[material].signal_speed(dim),
        substeps=1,
        volume_ratio=np.array([ratio], dtype=np.float32),
    )
    for _ in range(100):
        solver.advance(100)
        assert solver.diagnostics().max_speed < sound
        # Half a cell away, where it swells or shrinks.
        assert 0.5 * np.abs(solver.affine).max() / 32 < sound


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("place", ["free", "wall", "corner"])
@pytest.mark.parametrize(
    ("material", "ratios"), [("water", (0.9, 1.1)), ("sand", (0.5, 2.0)), ("elastic", (0.9, 1.1))]
)
def test_a_particle_alone_stays_bounded(
    build: Build, material: str, ratios: tuple[float, float], place: str, dim: int
) -> None:
    """Isolated particles are stiffer than the bulk (Sun, Shinar and Schroeder 2020)."""
    rng = np.random.default_rng(dim)
    for ratio in (*ratios, rng.uniform(*ratios)):
        x = rng.uniform(0.45, 0.55, (1, dim))
        touching = {"free": 0, "wall": 1, "corner": dim}[place]
        x[0, :touching] = 0.1 + rng.uniform(0, 1 / 32, touching)
        assert_bounded(build, material, x, ratio)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("material", ["water", "elastic"])
def test_a_particle_alone_and_far_from_rest_stays_bounded(build: Build, material: str, dim: int) -> None:
    assert_bounded(build, material, np.random.default_rng(0).uniform(0.45, 0.55, (1, dim)), 2.0)


CORNER = {2: 48, 3: 16}
"""Cells per metre by dimension."""


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("material", MATERIALS)
def test_everything_thrown_into_a_corner_is_survived(build: Build, material: str, dim: int) -> None:
    """The scene that sent taichi's particles out of the corner (its pull request 8260)."""
    x = block(0.1, 0.9, CORNER[dim], dim)
    gravity = [0.0, -9.81, 0.0][:dim]
    solver = build(x, -10.0, MATERIALS[material], resolution=CORNER[dim], gravity=gravity)
    solver.advance(120)
    assert ((solver.positions >= 0.1) & (solver.positions <= 0.9)).all()
    assert np.isfinite(solver.velocities).all()


def test_water_thrown_into_a_corner_fills_the_box_again(build: Build) -> None:
    x = block(0.1, 0.9, 64)
    solver = build(x, -10.0, WATER, resolution=64, gravity=[0.0, -9.81])
    solver.advance(400)
    # A full box has its centroid in the middle, lower by its compression of 1.4 %.
    np.testing.assert_allclose(solver.diagnostics().centroid, 0.5, atol=0.02)


@pytest.mark.parametrize("cells", [1, 2])
@pytest.mark.parametrize("material", MATERIALS)
def test_checkerboard_noise_decays(build: Build, material: str, cells: int) -> None:
    """Velocities that alternate between neighbours, which the grid hardly sees (Gritton and Berzins 2017)."""
    x = block(0.35, 0.65, 64)
    site = np.rint((x - x.min(axis=0)) * 128).astype(int)
    sign = 1.0 - 2.0 * ((site // cells).sum(axis=1) % 2)
    solver = build(x, np.stack([sign, np.zeros_like(sign)], axis=1), MATERIALS[material], resolution=64)
    start = energy(solver)
    solver.advance(1)
    assert energy(solver) < 1e-2 * start
    solver.advance(200)
    assert energy(solver) < 1e-3 * start


@pytest.mark.parametrize("dim", [2, 3])
def test_an_elastic_bounce_gains_no_energy(dim: int) -> None:
    ball = Ball(material=Elastic(youngs_modulus=1e5, wall_friction=0.0), center=(0.5,) * dim, radius=0.1)
    solver = MpmSolver(Scene(dim=dim, resolution=64 if dim == 2 else 24, bodies=(ball,)))
    totals = solver.diagnostics()
    floor = totals.mass * 9.81 * 0.2  # potential energy of the ball at rest on the floor
    start = energy(solver)
    energies = []
    for _ in range(400):
        solver.advance()
        energies.append(energy(solver))
    assert max(energies) <= start + 1e-6 * (start - floor)
    assert max(np.diff(energies)) < 3e-3 * (start - floor)
    assert totals.centroid[1] - solver.diagnostics().centroid[1] > 0.0

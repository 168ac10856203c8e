"""Volume: water under its own weight and through splashes, sand that separates and comes together again."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import Box, MpmSolver, Scene, Water, _native

Build = Callable[..., _native.Solver]

RESOLUTION = 40
SPACING = 0.5 / RESOLUTION


def sites(across: float, up: float) -> npt.NDArray[np.float64]:
    """Positions of two particles per cell and axis in a block on the floor and the left wall."""
    x, y = (np.arange(0.1 + SPACING / 2, 0.1 + length, SPACING) for length in (across, up))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("bulk_modulus", [277_778.0, 50_000.0])
def test_water_is_compressed_by_its_own_weight_as_the_formula_says(build: Build, bulk_modulus: float) -> None:
    """Equilibrium of p = lambda (1 - J): J = 1 - rho g (H - Y) / lambda, Y being the height at rest."""
    height, per_height = 0.4, 1000 * 9.81 / bulk_modulus
    x = sites(0.2, height)
    rest = x[:, 1] - 0.1
    x[:, 1] = 0.1 + rest - per_height * (height * rest - rest**2 / 2)
    solver = build(
        x,
        0.0,
        _native.Material.water(density=1000.0, bulk_modulus=bulk_modulus),
        resolution=RESOLUTION,
        gravity=[0.0, -9.81],
        wall_upper=[0.3, 0.9],
        volume_ratio=(1 - per_height * (height - rest)).astype(np.float32),
    )
    compressions = []
    for _ in range(200):
        solver.advance(4)
        compressions.append(1 - float(solver.volume_ratio.mean()))
    assert np.mean(compressions) == pytest.approx(per_height * height / 2, rel=0.1)


def separated_and_settled(build: Build, *, correction: bool) -> tuple[float, float]:
    """Stretch a bed of sand by a fifth in flight and let it fall back; (largest, last) depth ratio."""
    sand = _native.Material.sand(
        density=1000.0,
        youngs_modulus=1e6,
        poisson_ratio=0.2,
        friction_angle=30.0,
        wall_friction=0.0,
        volume_correction=correction,
    )
    solver = build(
        sites(0.4, 0.2), 0.0, sand, resolution=RESOLUTION, gravity=[0.0, -9.81], wall_upper=[0.5, 0.9]
    )
    solver.advance(200)

    def depth() -> float:
        return 2 * (solver.diagnostics().centroid[1] - 0.1)

    bed = depth()
    lift = np.zeros_like(solver.positions)
    lift[:, 1] = 9.81 + 100 * (solver.positions[:, 1] - 0.1)
    solver.advance(16, lift)
    largest = bed
    for _ in range(30):
        solver.advance(2)
        largest = max(largest, depth())
    solver.advance(300)
    return largest / bed, depth() / bed


def test_sand_takes_back_the_volume_that_it_gained(build: Build) -> None:
    """Without the correction (Tampubolon et al. 2017) sand keeps every expansion for good."""
    largest, settled = separated_and_settled(build, correction=True)
    assert largest > 1.15
    assert abs(settled - 1) < 0.03
    largest, settled = separated_and_settled(build, correction=False)
    assert settled > 1.15


def test_sand_keeps_its_volume_when_it_drops(build: Build) -> None:
    sand = _native.Material.sand(
        density=1000.0, youngs_modulus=1e6, poisson_ratio=0.2, friction_angle=30.0, wall_friction=0.0
    )
    x = sites(0.4, 0.2) + np.array([0.0, 0.3])
    solver = build(x, 0.0, sand, resolution=RESOLUTION, gravity=[0.0, -9.81], wall_upper=[0.5, 0.9])
    solver.advance(500)
    assert 2 * (solver.diagnostics().centroid[1] - 0.1) == pytest.approx(0.2, rel=0.03)


def double_dam_break(solver: MpmSolver, frames: int) -> float:
    """Depth [m] after so many frames, as the mean over one more second."""
    solver.advance(frames)
    heights = []
    for _ in range(100):
        solver.advance(4)
        heights.append(solver.diagnostics().centroid[1])
    return float(2 * (np.mean(heights) - 0.1))


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("resolution", [64, 128])
def test_water_keeps_its_volume_for_half_a_minute_after_two_dam_breaks(resolution: int) -> None:
    """The twin of 10 s stands in rust/mpm/src/tests/laws.rs."""
    water = Water()
    left = Box(material=water, lower=(0.1, 0.1), upper=(0.3, 0.5))
    right = Box(material=water, lower=(0.7, 0.1), upper=(0.9, 0.5))
    solver = MpmSolver(Scene(dim=2, resolution=resolution, bodies=(left, right)))
    filled = solver.particle_count * solver.scene.spacing**2 / 0.8
    assert double_dam_break(solver, 12_000) == pytest.approx(filled, rel=0.05)

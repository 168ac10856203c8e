"""Translation, stretching and rest: what the grid must not add to a motion."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm import _native

Build = Callable[..., _native.Solver]

MATERIALS = {
    "water": _native.Material.water(density=1000.0, bulk_modulus=277_778.0),
    "sand": _native.Material.sand(density=1000.0, youngs_modulus=1e6, poisson_ratio=0.2, friction_angle=45.0),
    "elastic": _native.Material.elastic(density=1000.0, youngs_modulus=3e5, poisson_ratio=0.2),
}


def lattice(lower: list[float], upper: list[float], resolution: int) -> npt.NDArray[np.float64]:
    """Positions of two particles per cell and axis in a box."""
    half = 0.25 / resolution
    axes = [np.arange(a + half, b, 2 * half) for a, b in zip(lower, upper, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(lower))


@pytest.mark.parametrize(
    ("material", "dim"),
    [("water", 2), ("sand", 2), ("elastic", 2), ("water", 3), ("sand", 3), ("elastic", 3)],
)
def test_a_block_keeps_its_velocity_across_ten_cells(build: Build, material: str, dim: int) -> None:
    """Linear kernels push particles that cross a cell's edge (Steffen et al. 2008), quadratic ones do not."""
    resolution = {2: 64, 3: 32}[dim]
    v = np.array([1.0, 0.5, 0.25][:dim])
    x = lattice([0.15] * dim, [0.3] * dim, resolution)
    solver = build(x, v, MATERIALS[material], resolution=resolution)
    for _ in range(int(10 / resolution / 0.0025) + 1):
        solver.advance()
        np.testing.assert_allclose(solver.velocities, np.broadcast_to(v, x.shape), atol=1e-4)
    np.testing.assert_allclose(
        solver.positions - x, (solver.positions - x)[[0]].repeat(len(x), 0), atol=2e-3 / resolution
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_a_bar_holds_together_until_it_is_twice_as_long(build: Build, dim: int) -> None:
    """A very soft bar is pulled evenly; it breaks where neighbours no longer share a grid node."""
    resolution = {2: 64, 3: 32}[dim]
    x = lattice([0.42] + [0.47] * (dim - 1), [0.58] + [0.53] * (dim - 1), resolution)
    v = np.zeros_like(x)
    v[:, 0] = 4.0 * (x[:, 0] - 0.5)
    soft = _native.Material.elastic(density=1000.0, youngs_modulus=10.0, poisson_ratio=0.0)
    solver = build(x, v, soft, resolution=resolution)
    length, stretch = np.ptp(x[:, 0]), 1.0
    while stretch < 2.0:
        solver.advance()
        now = solver.positions
        stretch = np.ptp(now[:, 0]) / length
        mass = _native.grid_mass(now, np.ones(len(now), np.float32), resolution)
        along = mass.sum(axis=tuple(range(1, dim)))
        first, last = np.nonzero(along)[0][[0, -1]]
        assert (along[first:last] > 0).all(), f"split at a stretch of {stretch:.2f}"


def test_water_at_rest_neither_clumps_nor_grows_noisy(build: Build) -> None:
    resolution, depth = 40, 0.2
    x = lattice([0.1, 0.1], [0.5, 0.1 + depth], resolution)
    x += np.random.default_rng(0).uniform(-0.125, 0.125, x.shape) / resolution
    solver = build(
        x, 0.0, MATERIALS["water"], resolution=resolution, gravity=[0.0, -9.81], wall_upper=[0.5, 0.9]
    )
    solver.advance(4000)
    x = solver.positions
    # Cells two away from walls and surface hold four particles on average.
    cells = [np.arange(0.15, 0.4501, 1 / resolution), np.arange(0.15, 0.2501, 1 / resolution)]
    counts = np.histogram2d(x[:, 0], x[:, 1], bins=cells)[0]
    assert counts.min() >= 2
    assert counts.max() <= 8
    assert pressure_noise(solver, resolution) < 0.1 * 1000 * 9.81 * depth
    assert solver.diagnostics().max_speed < 0.01


def pressure_noise(solver: _native.Solver, resolution: int) -> float:
    """Return how far the pressure on inner grid nodes strays from a line, as a standard deviation [Pa]."""
    x, shift = solver.positions, 1e6
    pressure = (277_778.0 * (1 - solver.volume_ratio) + shift).astype(np.float32)
    mass = _native.grid_mass(x, np.ones(len(x), np.float32), resolution)
    mean = _native.grid_mass(x, pressure, resolution)[6:19, 6:11] / mass[6:19, 6:11] - shift
    height = np.tile(np.arange(6, 11) / resolution, 13)
    line = np.polyfit(height, mean.ravel(), 1)
    return float(np.std(mean.ravel() - np.polyval(line, height)))

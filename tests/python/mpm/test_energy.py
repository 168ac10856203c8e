"""The correction of volumes adds no energy."""

import pytest

from hybridmpm import Box, Elastic, MpmSolver, Scene


def energy(solver: MpmSolver) -> float:
    found = solver.diagnostics()
    return found.kinetic_energy + found.potential_energy + found.elastic_energy


@pytest.mark.parametrize("kind", ["sand", "water"])
@pytest.mark.parametrize("per_cell", [1, 2, 4, 9])
def test_a_block_that_creeps_into_a_corner_gains_no_energy(kind: str, per_cell: int) -> None:
    block = Box(material=kind, lower=(0.11, 0.73), upper=(0.2, 0.9), velocity=(0.0225, 0.045))
    scene = Scene(dim=2, resolution=64, particles_per_cell=per_cell, gravity=(0, 0), bodies=[block])
    solver = MpmSolver(scene)
    start = energy(solver)
    for _ in range(80):
        solver.advance(5)
        assert energy(solver) <= start * (1 + 1e-4)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("kind", ["sand", "water"])
def test_sparse_matter_that_is_dropped_gains_no_energy(kind: str, dim: int) -> None:
    lower, upper = (0.3, 0.15, 0.3)[:dim], (0.6, 0.4, 0.5)[:dim]
    block = Box(material=kind, lower=lower, upper=upper, velocity=(1.0, -1.0, 0.5)[:dim])
    solver = MpmSolver(Scene(dim=dim, resolution=32, particles_per_cell=1, bodies=[block]))
    start = energy(solver)
    for _ in range(60):
        solver.advance(5)
        assert energy(solver) <= start * (1 + 1e-4)


@pytest.mark.parametrize(
    "material",
    ["sand", "water", pytest.param(Elastic(), marks=pytest.mark.long)],
    ids=["sand", "water", "elastic"],
)
@pytest.mark.parametrize("free", [0.0, 0.03])
def test_a_full_box_gains_little_energy(free: float, material: str | Elastic) -> None:
    """Sand stores the errors of its density, .5 % of its weight's energy in 2 s."""
    height = 0.8 * (1 - free)
    full = Box(material=material, lower=(0.1, 0.1), upper=(0.9, 0.1 + height))
    solver = MpmSolver(Scene(dim=2, resolution=64, bodies=[full]))
    start = solver.diagnostics()
    largest = 0.0
    for _ in range(10):
        solver.advance(80)
        largest = max(largest, energy(solver) - start.potential_energy)
    assert largest < 0.01 * start.mass * 9.81 * height

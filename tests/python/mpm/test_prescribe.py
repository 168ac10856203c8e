"""Motion that somebody else prescribes to the solver."""

import numpy as np
import pytest

from hybridmpm import (
    BallSink,
    Box,
    BoxObstacle,
    ConfigError,
    DomainError,
    MpmSolver,
    NonFiniteError,
    Scene,
    Sleep,
    Water,
)


def block(material: str | Water = "water", **fields: object) -> Scene:
    body = Box(material=material, lower=(0.3, 0.3), upper=(0.6, 0.6))
    return Scene(dim=2, resolution=64, bodies=(body,), **fields)


def inner(x: np.ndarray) -> np.ndarray:
    """Return which particles are far from the surface of the block."""
    return (np.abs(x - 0.45) < 0.1).all(axis=1)


@pytest.mark.parametrize("gradient", [[[0.0, -3.0], [3.0, 0.0]], [[2.0, 1.0], [0.0, -1.0]]])
def test_affine_matrices_are_the_gradient_of_the_velocity(gradient: list[list[float]]) -> None:
    solver = MpmSolver(block())
    x = solver.positions
    v = ((x - 0.45) @ np.array(gradient).T).astype(np.float32)
    solver.prescribe(x, v, 7)
    assert solver.frame == 7
    np.testing.assert_array_equal(solver.positions, x)
    np.testing.assert_array_equal(solver.velocities, v)
    # One transfer takes velocities for constant around particles, which are placed at random.
    C = solver.affine[inner(x)]
    np.testing.assert_allclose(C.mean(axis=0), gradient, atol=0.05)
    assert np.abs(C - gradient).max() < 1.0
    solver.prescribe(x, v, 7, affine=False)
    assert not solver.affine.any()


# Where the density contradicts it, J of water is led back: here particles stay where they are.
@pytest.mark.parametrize("material", [Water(volume_correction=False), "elastic"])
def test_materials_deform_by_the_affine_matrices(material: str | Water) -> None:
    solver = MpmSolver(block(material))
    x = solver.positions
    v = (10 * (x - 0.45)).astype(np.float32)
    solver.prescribe(x, v, 4)
    assert (solver.volume_ratio == 1).all()
    solver.prescribe(x, v, 8, deform=True)
    # dJ/dt = J div v over 10 ms.
    grown = np.exp(20 * 0.01)
    assert solver.volume_ratio[inner(x)].mean() == pytest.approx(grown, rel=0.01)


def test_sand_that_comes_apart_bears_no_stress() -> None:
    solver = MpmSolver(block("sand"))
    x = solver.positions
    solver.prescribe(x, (5 * (x - 0.45)).astype(np.float32), 4, deform=True)
    np.testing.assert_allclose(solver.volume_ratio[inner(x)], 1, atol=1e-5)


def test_the_report_tells_density_divergence_and_energy() -> None:
    solver = MpmSolver(block())
    x = solver.positions
    v = np.tile(np.array([1.0, -2.0], dtype=np.float32), (len(x), 1))
    report = solver.prescribe(x, v, 0)
    totals = solver.diagnostics()
    assert report.kinetic_energy == pytest.approx(totals.kinetic_energy)
    assert report.potential_energy == pytest.approx(totals.potential_energy)
    assert report.divergence == pytest.approx(0, abs=1e-3)
    assert 1 < report.density < 1.2
    denser = solver.prescribe((0.45 + 0.7 * (x - 0.45)).astype(np.float32), v, 0)
    assert denser.density == pytest.approx(report.density / 0.49, rel=0.1)


def test_particles_are_put_back_to_walls_and_obstacles() -> None:
    solver = MpmSolver(block(obstacles=(BoxObstacle(lower=(0.7, 0.1), upper=(0.8, 0.5)),)))
    x, v = solver.positions.copy(), solver.velocities.copy()
    x[0], v[0] = (0.1 - 0.01, 0.5), (-1, 3)
    x[1], v[1] = (0.71, 0.3), (2, 0)
    solver.prescribe(x, v, 1)
    np.testing.assert_allclose(solver.positions[0], (0.1, 0.5))
    np.testing.assert_allclose(solver.velocities[0], (0, 3))
    np.testing.assert_allclose(solver.positions[1], (0.7, 0.3), atol=1e-6)
    np.testing.assert_array_equal(solver.positions[2:], x[2:])


def test_what_cannot_be_is_refused_and_changes_nothing() -> None:
    solver = MpmSolver(block())
    solver.advance(3)
    before = solver.snapshot()
    x, v = solver.positions, solver.velocities
    broken, far = x.copy(), x.copy()
    broken[5, 1], far[9] = np.nan, (0.05, 0.5)
    with pytest.raises(NonFiniteError, match="particle 5"):
        solver.prescribe(broken, v, 4)
    with pytest.raises(NonFiniteError, match="particle 5"):
        solver.prescribe(x, broken, 4)
    with pytest.raises(DomainError, match="particle 9"):
        solver.prescribe(far, v, 4)
    with pytest.raises(ConfigError, match=r"v must be float32 of shape \(\d+, 2\), got shape"):
        solver.prescribe(x, v[:3], 4)
    with pytest.raises(ConfigError, match="frame must be in"):
        solver.prescribe(x, v, -1)
    assert solver.snapshot() == before


def test_scenes_whose_particles_come_go_or_sleep_are_refused() -> None:
    sink = MpmSolver(block(sinks=(BallSink(center=(0.5, 0.2), radius=0.05),)))
    asleep = MpmSolver(block(), sleep=Sleep())
    for solver in (sink, asleep):
        with pytest.raises(ConfigError, match="without emitters, sinks, sleep and rigid bodies"):
            solver.prescribe(solver.positions, solver.velocities, 1)

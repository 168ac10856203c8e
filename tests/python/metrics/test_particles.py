"""Measures of particles against values worked out by hand."""

from collections.abc import Callable

import numpy as np
import pytest

from hybridmpm import BallObstacle, Box, ConfigError, Motion, MpmSolver, Scene, Walls, metrics

TWO = np.array([[0.25, 0.5], [0.75, 0.5]])


def test_kinetic_energy_by_hand() -> None:
    # 2 * 5^2 / 2 + 4 * 1 / 2
    v = np.array([[3.0, 4.0], [0.0, 1.0]])
    assert metrics.kinetic_energy(v, [2.0, 4.0]) == pytest.approx(27)
    np.testing.assert_allclose(metrics.kinetic_energy([v, 2 * v], [2.0, 4.0]), [27, 108])


def test_potential_energy_by_hand() -> None:
    # 2 kg at height 0.5 m, 4 kg at 0.25 m, under 10 m/s^2
    x = [[0.9, 0.5], [0.1, 0.25]]
    assert metrics.potential_energy(x, [2.0, 4.0], (0.0, -10.0)) == pytest.approx(20)


def test_energies_are_those_of_the_solver(solver: MpmSolver) -> None:
    solver.advance(5)
    seen = solver.diagnostics()
    kinetic = metrics.kinetic_energy(solver.velocities, solver.mass)
    potential = metrics.potential_energy(solver.positions, solver.mass, solver.scene.gravity)
    assert kinetic == pytest.approx(seen.kinetic_energy, rel=1e-5)
    assert potential == pytest.approx(seen.potential_energy, rel=1e-5)


def test_energy_error_by_hand() -> None:
    np.testing.assert_allclose(metrics.energy_error([3.0, 4.0, 1.0], [2.0, 4.0, 0.0]), [0.25, 0, 0.25])


@pytest.mark.parametrize(
    ("predicted", "true"), [([1.0], [1.0, 2.0]), ([], []), ([np.nan], [1.0]), ([1.0, 1.0], [0.0, 0.0])]
)
def test_energy_error_refuses(predicted: list[float], true: list[float]) -> None:
    with pytest.raises(ConfigError):
        metrics.energy_error(predicted, true)


def test_centroid_error_by_hand() -> None:
    # centres (0.5, 0.5) and (0.375, 0.5): the heavier particle draws the second
    error = metrics.centroid_error(TWO, [1.0, 1.0], TWO, [3.0, 1.0])
    assert error == pytest.approx(0.125)
    shifted = TWO + np.array([0.03, -0.04])
    np.testing.assert_allclose(
        metrics.centroid_error([TWO, shifted], [1, 1], [TWO, TWO], [1, 1]), [0, 0.05], atol=1e-7
    )


def test_centroid_of_another_number_of_particles() -> None:
    assert metrics.centroid_error([[0.5, 0.5]], [7.0], TWO, [1.0, 1.0]) == pytest.approx(0)


def test_density_extremes_by_hand() -> None:
    # On a node the weights are 1/8, 3/4, 1/8: sum w^2 = (38/64)^2 of m / dx^2 comes back to the particle.
    x = [[0.25, 0.5], [0.75, 0.5]]
    expected = np.array([1.0, 2.0]) * (38 / 64) ** 2 * 8**2
    np.testing.assert_allclose(metrics.density_extremes(x, [1.0, 2.0], 8), expected)
    assert metrics.density_extremes([x, x, x], [1.0, 2.0], 8).shape == (3, 2)


def test_density_inside_a_body_is_its_own() -> None:
    scene = Scene(dim=2, bodies=(Box(material="water", lower=(0.3, 0.3), upper=(0.7, 0.7)),))
    particles = scene.sample()
    low, high = metrics.density_extremes(particles.x, particles.mass, scene.resolution)
    assert high == pytest.approx(1000, rel=0.1)
    assert 200 < low < 600


def test_neighbour_histograms_by_hand() -> None:
    # Numbers of neighbours within 0.15: (1, 2, 1) in a row, (0, 1, 1) with the first taken away.
    row = np.array([[0.1, 0.5], [0.2, 0.5], [0.3, 0.5]])
    apart = np.array([[0.9, 0.5], [0.2, 0.5], [0.3, 0.5]])
    # Sorted (0, 1, 1) and (1, 1, 2) differ by (1, 0, 1).
    assert metrics.neighbour_histogram_distance(apart, row, 0.15) == pytest.approx(2 / 3)
    both = metrics.neighbour_histogram_distance([apart, row], [row, row], 0.15)
    np.testing.assert_allclose(both, [2 / 3, 0])


def test_neighbours_within_their_own_radius() -> None:
    rng = np.random.default_rng(0)
    x = rng.uniform(0.2, 0.4, (200, 2))
    assert metrics.neighbour_histogram_distance(2 * x, x, 0.02, predicted_radius=0.04) < 0.02
    assert metrics.neighbour_histogram_distance(2 * x, x, 0.02) > 1


def test_penetrations_by_hand() -> None:
    scene = Scene(
        dim=2,
        walls=Walls(lower=(0.1, 0.1), upper=(0.9, 0.9)),
        bodies=(Box(material="water", lower=(0.2, 0.2), upper=(0.3, 0.3)),),
        obstacles=(
            BallObstacle(center=(0.5, 0.5), radius=0.1, motion=Motion(velocity=(0.0, 0.1))),
            BallObstacle(center=(0.5, 0.15), radius=0.02),
        ),
        frame_dt=0.1,
    )
    inside, touching, past, free = (0.5, 0.415), (0.5, 0.13), (0.0999, 0.5), (0.2, 0.2)
    x = np.array([inside, touching, past, free])
    # In frame 1 the first ball has moved up by 0.01 m, in frame 3 by 0.03 m and away from the first particle.
    assert metrics.penetration_count(scene, x) == 2
    assert metrics.penetration_count(scene, [x] * 3).tolist() == [2, 2, 1]
    assert metrics.penetration_count(scene, [x] * 2, first_frame=1, every=2).tolist() == [2, 1]
    assert metrics.penetration_count(scene, x, tolerance=0.001) == 1
    assert metrics.penetration_count(scene, x, tolerance=0.02) == 0


@pytest.mark.parametrize(
    "measure",
    [
        lambda: metrics.kinetic_energy(TWO, [1.0]),
        lambda: metrics.kinetic_energy([1.0, 2.0], [1.0]),
        lambda: metrics.kinetic_energy(TWO * np.nan, [1.0, 1.0]),
        lambda: metrics.potential_energy(TWO, [1.0, -1.0], (0.0, -1.0)),
        lambda: metrics.potential_energy(TWO, [1.0, 1.0], (0.0, -1.0, 0.0)),
        lambda: metrics.centroid_error(TWO, [1, 1], [TWO, TWO], [1, 1]),
        lambda: metrics.density_extremes(TWO + 1, [1, 1], 8),
        lambda: metrics.density_extremes(TWO, [1, 1], 4),
        lambda: metrics.neighbour_histogram_distance(TWO, [TWO], 0.1),
        lambda: metrics.neighbour_histogram_distance(TWO, TWO, -0.1),
    ],
)
def test_bad_arguments(measure: Callable[[], object]) -> None:
    with pytest.raises(ConfigError):
        measure()

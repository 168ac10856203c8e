"""The three grid errors against values worked out by hand, and the laws they obey."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hybridmpm import ConfigError, metrics

ERRORS: list[Callable[[np.ndarray, np.ndarray], float]] = [
    metrics.grid_rmse,
    metrics.grid_nrmse,
    metrics.grid_node_error,
]
# m~_true = (0.5, 0.5, 0, 0), m~_pred = (0.75, 0, 0.25, 0) after division by the sums 4 and 8.
TRUE = np.array([[2.0, 2.0], [0.0, 0.0]])
PREDICTED = np.array([[6.0, 0.0], [2.0, 0.0]])


def test_rmse_by_hand() -> None:
    # difference (0.25, -0.5, 0.25, 0): norm sqrt(0.375); truth: norm sqrt(0.5)
    assert metrics.grid_rmse(PREDICTED, TRUE) == pytest.approx(np.sqrt(0.75))


def test_nrmse_by_hand() -> None:
    # sqrt(0.375 / 4 nodes) / 0.5
    assert metrics.grid_nrmse(PREDICTED, TRUE) == pytest.approx(np.sqrt(0.375 / 4) / 0.5)


def test_node_error_by_hand() -> None:
    # (0.25 / 0.5 + 0.5 / 0.5) / 4 nodes; the two empty nodes count in the mean only
    assert metrics.grid_node_error(PREDICTED, TRUE) == pytest.approx(0.375)


def test_node_error_takes_faint_nodes_for_empty() -> None:
    true = np.array([1.0, 0.0009, 0.0011])
    predicted = np.array([1.0, 0.5, 0.0011])
    t, p = true / true.sum(), predicted / predicted.sum()
    expected = (abs(p[0] - t[0]) / t[0] + abs(p[2] - t[2]) / t[2]) / 3
    assert metrics.grid_node_error(predicted, true) == pytest.approx(expected)


@pytest.mark.parametrize("error", ERRORS)
def test_zero_for_equal_states_of_any_mass(error: Callable[[np.ndarray, np.ndarray], float]) -> None:
    assert error(TRUE, TRUE) == 0
    assert error(7 * PREDICTED, PREDICTED) == pytest.approx(0, abs=1e-15)


def test_states_that_share_no_node() -> None:
    assert metrics.grid_rmse(TRUE[::-1], TRUE) == pytest.approx(np.sqrt(2))


@pytest.mark.parametrize("error", [metrics.grid_rmse, metrics.grid_nrmse, metrics.grid_node_error])
def test_many_frames_are_as_many_grids(error: Any) -> None:
    frames = np.stack([PREDICTED, TRUE, TRUE[::-1]])
    errors = error(frames, np.stack([TRUE] * 3), dim=2)
    assert errors.tolist() == [error(frame, TRUE) for frame in frames]


def test_dim_must_fit() -> None:
    with pytest.raises(ConfigError, match=r"dim must be in \[1, 2\], got 3"):
        metrics.grid_rmse(TRUE, TRUE, dim=3)


def test_grid_mass_of_frames() -> None:
    x = np.random.default_rng(1).uniform(0.2, 0.8, (3, 50, 2)).astype(np.float32)
    grids = metrics.grid_mass(x, np.ones(50), 16)
    assert grids.shape == (3, 17, 17)
    for grid, frame in zip(grids, x, strict=True):
        np.testing.assert_array_equal(grid, metrics.grid_mass(frame, np.ones(50), 16))


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize(
    ("predicted", "message"),
    [
        (np.ones((2, 3)), r"same shape, got \(2, 3\) and \(2, 2\)"),
        (np.zeros((2, 2)), "predicted must have finite masses"),
        (np.full((2, 2), np.nan), "predicted must have finite masses"),
        (np.array([[1.0, -1.0], [1.0, 1.0]]), "predicted must have finite masses >= 0"),
    ],
)
def test_bad_grids(
    error: Callable[[np.ndarray, np.ndarray], float], predicted: np.ndarray, message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        error(predicted, TRUE)


@pytest.mark.parametrize("dim", [2, 3])
def test_grid_mass_keeps_mass_and_centroid(dim: int) -> None:
    rng = np.random.default_rng(0)
    x = rng.uniform(0.2, 0.8, (500, dim))
    mass = rng.uniform(0.5, 1.5, 500)
    grid = metrics.grid_mass(x, mass, 16)
    assert grid.shape == (17,) * dim
    assert grid.dtype == np.float32
    assert grid.sum(dtype=np.float64) == pytest.approx(mass.sum(), rel=1e-5)
    nodes = np.stack(np.meshgrid(*[np.arange(17) / 16] * dim, indexing="ij"), axis=-1)
    centroid = (grid[..., None] * nodes).reshape(-1, dim).sum(axis=0) / mass.sum()
    np.testing.assert_allclose(centroid, (mass[:, None] * x).sum(axis=0) / mass.sum(), atol=1e-5)


def test_grid_mass_of_one_particle_on_a_node() -> None:
    """Quadratic B-spline weights at offsets -1, 0, 1 of a node are 1/8, 3/4, 1/8."""
    grid = metrics.grid_mass([[0.5, 0.25]], [64.0], 8)
    expected = np.zeros((9, 9))
    expected[3:6, 1:4] = np.outer([1, 6, 1], [1, 6, 1])
    np.testing.assert_allclose(grid, expected, rtol=1e-6)


def test_grid_mass_at_the_edge_stays_in_the_grid() -> None:
    grid = metrics.grid_mass([[0.0, 0.0], [1.0, 1.0]], [1.0, 1.0], 8)
    assert grid.sum() == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("x", "mass", "resolution"),
    [
        ([[0.5, 0.5]], [1.0, 1.0], 16),
        ([0.5, 0.5], [1.0, 1.0], 16),
        ([[0.5, np.nan]], [1.0], 16),
        ([[0.5, 1.5]], [1.0], 16),
        ([[0.5, 0.5]], [1.0], 4),
        ([[0.5]], [1.0], 16),
        ([[0.5, 0.5]], [1.0], -1),
    ],
)
def test_grid_mass_refuses(x: list[list[float]], mass: list[float], resolution: int) -> None:
    with pytest.raises(ConfigError):
        metrics.grid_mass(x, mass, resolution)

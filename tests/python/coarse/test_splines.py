"""The splines of Python are those of the core."""

import numpy as np
import pytest

from hybridmpm import metrics
from hybridmpm.coarse.splines import Stencils


@pytest.mark.parametrize("dim", [2, 3])
def test_scatter_is_the_grid_mass_of_the_core(dim: int) -> None:
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.random((200, dim)), np.zeros((1, dim)), np.ones((1, dim))]).astype(np.float32)
    mass = rng.uniform(0.5, 2, 202).astype(np.float32)
    grid = Stencils.at(x, 16).scatter(mass.astype(np.float64))
    np.testing.assert_allclose(grid, metrics.grid_mass(x, mass, 16), atol=1e-5)


def test_gather_of_a_linear_field_is_that_field() -> None:
    x = np.random.default_rng(1).uniform(0.2, 0.8, (50, 2))
    nodes = np.arange(17) / 16
    grid = 3 * nodes[:, None] - 2 * nodes[None, :] + 1
    np.testing.assert_allclose(Stencils.at(x, 16).gather(grid), 3 * x[:, 0] - 2 * x[:, 1] + 1)

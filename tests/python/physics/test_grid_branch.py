"""The grid branch: projection and reading back, scenes apart, what it reaches, and what it learns from."""

import dataclasses
import itertools

import numpy as np
import pytest
import torch

from hybridmpm.errors import ConfigError
from hybridmpm.physics import NetworkSpec
from hybridmpm.training.physics.network.edges import EdgeList
from hybridmpm.training.physics.network.graph_network import GraphNetwork
from hybridmpm.training.physics.network.grid_branch import CHANNELS, GridBranch

NONE = torch.zeros(0, dtype=torch.int64)


def _spec(dim: int, cells: int) -> NetworkSpec:
    return NetworkSpec(
        scenarios=(f"water_{dim}d",), latent=8, layers=1, hidden_layers=1, radius=0.1, grid_cells=cells
    )


def _branch(dim: int = 2, cells: int = 32) -> GridBranch:
    torch.manual_seed(dim)
    branch = GridBranch(_spec(dim, cells))
    torch.nn.init.normal_(branch.up.weight)
    return branch


def _alone(count: int) -> EdgeList:
    return EdgeList(NONE, NONE, [count])


@pytest.mark.parametrize("dim", [2, 3])
def test_nodes_are_projected_with_linear_weights_and_read_back_with_the_same(dim: int) -> None:
    cells, count = 5, 12
    branch = _branch(dim, cells)
    # The convolutions are taken out, so that the cells themselves come back.
    branch.convolutions = torch.nn.Sequential()
    branch.up = torch.nn.Linear(CHANNELS + 1, 8, bias=False)
    # Some nodes lie in the outer half of a cell, and some outside of the box.
    x, latents = torch.rand(count, dim) * 1.3 - 0.15, torch.randn(count, 8)
    values = torch.cat([branch.down(latents), torch.ones(count, 1)], dim=1).detach().numpy()
    sums, weights = np.zeros((*[cells] * dim, CHANNELS + 1)), []
    for place, value in zip(np.clip(x.numpy() * cells - 0.5, 0, cells - 1), values, strict=True):
        mine = {}
        for corner in itertools.product((0, 1), repeat=dim):
            cell = np.minimum(np.floor(place).astype(int) + corner, cells - 1)
            weight = float(np.prod(np.where(corner, place % 1, 1 - place % 1)))
            mine[tuple(cell)] = mine.get(tuple(cell), 0.0) + weight
        assert sum(mine.values()) == pytest.approx(1)
        weights.append(mine)
        for cell, weight in mine.items():
            sums[cell] += weight * value
    means = np.concatenate([sums[..., :-1] / (sums[..., -1:] + 0.5), sums[..., -1:]], axis=-1)
    back = np.array([sum(weight * means[cell] for cell, weight in mine.items()) for mine in weights])
    wanted = torch.from_numpy(back.astype(np.float32)) @ branch.up.weight.T
    torch.testing.assert_close(branch(latents, x, _alone(count)), wanted, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("dim", [2, 3])
def test_scenes_of_a_batch_do_not_see_each_other(dim: int) -> None:
    branch, counts = _branch(dim, 8), [20, 1, 7]
    x, latents = torch.rand(28, dim), torch.randn(28, 8)
    together = branch(latents, x, EdgeList(NONE, NONE, counts))
    parts = zip(latents.split(counts), x.split(counts), counts, strict=True)
    apart = torch.cat([branch(one, at, _alone(count)) for one, at, count in parts])
    torch.testing.assert_close(together, apart, rtol=1e-4, atol=1e-5)


def test_it_reaches_farther_than_the_graph() -> None:
    branch = _branch()
    x, latents = torch.tensor([[0.2, 0.2], [0.4, 0.2], [0.9, 0.9]]), torch.randn(3, 8)
    moved = torch.cat([latents[:1], latents[1:2] + 1, latents[2:]])
    change = branch(moved, x, _alone(3)) - branch(latents, x, _alone(3))
    # Cells are 1/32 m wide: the second node is six of them away, four radii of 0.05 m; the third 24.
    assert change[0].abs().max() > 1e-4
    assert change[2].abs().max() < 1e-6


def test_an_untrained_branch_changes_nothing() -> None:
    spec = _spec(2, 16)
    torch.manual_seed(0)
    network = GraphNetwork(spec)
    plain = GraphNetwork(dataclasses.replace(spec, grid_cells=0))
    plain.load_state_dict({k: v for k, v in network.state_dict().items() if not k.startswith("grid.")})
    nodes, types = torch.randn(9, spec.node_features - 16), torch.zeros(9, dtype=torch.int64)
    inputs = (torch.rand(9, 2), nodes, types, torch.zeros(0, 3), _alone(9))
    torch.testing.assert_close(network(*inputs), plain(*inputs))
    # It is trained nevertheless: the loss moves the last map, which is zero now.
    network(*inputs).square().sum().backward()
    assert network.grid is not None
    assert network.grid.up.weight.grad is not None
    assert network.grid.up.weight.grad.abs().max() > 0


@pytest.mark.parametrize("cells", [-1, 3, 65])
def test_other_grids_are_refused(cells: int) -> None:
    with pytest.raises(ConfigError, match=r"grid_cells .* \[4, 64\]"):
        _spec(2, cells)

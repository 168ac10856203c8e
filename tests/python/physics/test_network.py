"""The network's features and algebra, and its grid branch."""

import dataclasses
import itertools

import numpy as np
import numpy.typing as npt
import pytest
import torch

from hybridmpm import radius_graph
from hybridmpm.errors import ConfigError
from hybridmpm.physics import NetworkSpec
from hybridmpm.physics.model import edge_inputs
from hybridmpm.physics.spec import HISTORY
from hybridmpm.training.physics.network.edges import EdgeList, SortedEdges
from hybridmpm.training.physics.network.features import edge_features, node_features, step_velocities
from hybridmpm.training.physics.network.graph_network import GraphNetwork, Layer
from hybridmpm.training.physics.network.grid_branch import CHANNELS, GridBranch

SPEC = NetworkSpec(scenarios=("water_2d",), latent=16, layers=2, hidden_layers=2, radius=0.15)


def _graphs(count: int, seed: int) -> tuple[EdgeList, SortedEdges]:
    x = np.random.default_rng(seed).uniform(0.1, 0.9, (count, 2)).astype(np.float32)
    graph = radius_graph(x, SPEC.radius)
    ends = [torch.from_numpy(ids.astype(np.int64)) for ids in (graph.senders, graph.receivers)]
    plain = [torch.from_numpy(array) for array in edge_inputs(graph).values()]
    return EdgeList(*ends, [count]), SortedEdges(*plain)


def test_the_first_edge_map_is_that_of_the_concatenation() -> None:
    torch.manual_seed(1)
    layer, (graph, _) = Layer(SPEC), _graphs(60, 1)
    nodes = torch.randn(60, SPEC.latent)
    edges = torch.randn(len(graph.from_senders(nodes)), SPEC.latent)
    ends = [graph.from_senders(nodes), graph.from_receivers(nodes)]
    weight = torch.cat([layer.edge.weight, layer.sender.weight, layer.receiver.weight], dim=1)
    first = torch.cat([edges, *ends], dim=1) @ weight.T + layer.edge.bias
    message = layer.edge_rest(first)
    _, updated = layer(nodes, edges, graph)
    torch.testing.assert_close(updated, edges + message)


@pytest.mark.parametrize("seed", range(5))
def test_lists_and_sorted_edges_give_the_same(seed: int) -> None:
    torch.manual_seed(seed)
    network = GraphNetwork(SPEC)
    lists, ordered = _graphs(80, seed)
    x, nodes, types = torch.rand(80, 2), torch.randn(80, SPEC.node_features - 16), torch.randint(0, 9, (80,))
    edges = torch.randn(len(lists.from_senders(nodes)), SPEC.edge_features)
    one, two = (network(x, nodes, types, edges, one) for one in (lists, ordered))
    torch.testing.assert_close(one, two, rtol=1e-4, atol=1e-5)


def test_isolated_nodes_receive_nothing() -> None:
    far = torch.eye(3, 2)
    lists, ordered = (
        EdgeList(*torch.zeros(2, 0, dtype=torch.int64), [3]),
        edge_inputs(radius_graph(far.numpy().astype(np.float32), 0.1)),
    )
    table = SortedEdges(*(torch.from_numpy(array) for array in ordered.values()))
    assert lists.sum(torch.ones(0, 4)).eq(0).all()
    assert table.sum(torch.ones(1, 4)).eq(0).all()


def test_one_way_edges_go_one_way() -> None:
    # Particle 1 hears of 0, and 0 of nobody: what is swapped shows.
    graph = EdgeList(torch.tensor([0]), torch.tensor([1]), [2])
    nodes = torch.tensor([[1.0], [2.0]])
    assert graph.from_senders(nodes).tolist() == [[1.0]]
    assert graph.from_receivers(nodes).tolist() == [[2.0]]
    assert graph.sum(torch.tensor([[5.0]])).tolist() == [[0.0], [5.0]]


def test_the_papers_size() -> None:
    """Latent 128, 10 layers, 2 hidden layers: about 1.59 million parameters."""
    network = GraphNetwork(NetworkSpec(scenarios=("water_2d",), radius=0.015))
    assert sum(parameter.numel() for parameter in network.parameters()) == pytest.approx(1.59e6, rel=0.01)
    assert network.encoder.node.in_features == 30
    spatial = NetworkSpec(scenarios=("water_3d",), radius=0.03)
    assert GraphNetwork(spatial).encoder.node.in_features == 37


RADIUS = 0.05
WALLS = np.array([[0.1, 0.1], [0.9, 0.9]], dtype=np.float32)
MEAN, STD = np.array([0.0, -0.002]), np.array([0.004, 0.005])


def _nodes(x: npt.NDArray[np.float32], walls: npt.NDArray[np.float32] = WALLS) -> npt.NDArray[np.float32]:
    scales = (torch.tensor(MEAN, dtype=torch.float32), torch.tensor(STD, dtype=torch.float32))
    features: npt.NDArray[np.float32] = node_features(
        torch.from_numpy(x), torch.from_numpy(walls), RADIUS, *scales
    ).numpy()
    return features


def _history(count: int, seed: int = 0) -> npt.NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.1, 0.3, (count, 2))
    return (start + np.cumsum(rng.normal(0, 0.004, (HISTORY, count, 2)), axis=0)).astype(np.float32)


def test_values_worked_out_by_hand() -> None:
    # One particle that falls faster and faster and drifts to the right, close to the left wall and the floor.
    heights = [0.17, 0.168, 0.164, 0.158, 0.15, 0.14]
    x = np.array([[[0.11 + 0.002 * k, heights[k]]] for k in range(HISTORY)], dtype=np.float32)
    expected = [
        # (velocity - mean) / std, the oldest first; across 0.002 / 0.004 throughout.
        *(0.5, 0.0, 0.5, -0.4, 0.5, -0.8, 0.5, -1.2, 0.5, -1.6),
        # Distances 0.02 and 0.04 to left wall and floor over R; right wall and ceiling are out of reach.
        *(0.4, 0.8, 1.0, 1.0),
    ]
    np.testing.assert_allclose(_nodes(x), [expected], atol=2e-5)
    np.testing.assert_allclose(step_velocities(torch.from_numpy(x))[-1], [[0.002, -0.01]], atol=1e-7)


def test_edge_values_worked_out_by_hand() -> None:
    x = torch.tensor([[0.5, 0.5], [0.53, 0.46], [0.5, 0.5]])
    # From 1 to 0, from 0 to 1, and between two particles in one place.
    graph = EdgeList(torch.tensor([1, 0, 2]), torch.tensor([0, 1, 0]), [3])
    expected = [[0.6, -0.8, 1.0], [-0.6, 0.8, 1.0], [0.0, 0.0, 1e-6]]
    np.testing.assert_allclose(edge_features(x, graph, RADIUS), expected, atol=2e-6)


def test_mirrored_particles_have_mirrored_features() -> None:
    x = _history(30)
    mirrored = x.copy()
    mirrored[..., 0] = 1.0 - x[..., 0]
    one, two = _nodes(x), _nodes(mirrored)
    turned = one.copy()
    turned[:, 0:10:2] *= -1.0
    turned[:, [10, 12]] = one[:, [12, 10]]
    np.testing.assert_allclose(two, turned, atol=5e-5)


def test_shifted_particles_and_walls_have_the_same_features() -> None:
    x, shift = _history(30), np.array([0.25, -0.125], dtype=np.float32)
    np.testing.assert_allclose(_nodes(x + shift, WALLS + shift), _nodes(x), atol=5e-5)


def test_no_particles_and_no_edges() -> None:
    assert _nodes(np.empty((HISTORY, 0, 2), np.float32)).shape == (0, 14)
    none = torch.zeros(0, dtype=torch.int64)
    assert edge_features(torch.rand(1, 2), EdgeList(none, none, [1]), RADIUS).shape == (0, 3)


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
    assert network.grid.up.weight.grad.abs().max() > 0


@pytest.mark.parametrize("cells", [-1, 3, 65])
def test_other_grids_are_refused(cells: int) -> None:
    with pytest.raises(ConfigError, match=r"grid_cells .* \[4, 64\]"):
        _spec(2, cells)

"""The network's algebra: the factorised layer, the two forms of a graph, counts of parameters."""

import numpy as np
import pytest
import torch

from hybridmpm import radius_graph
from hybridmpm.physics import NetworkSpec
from hybridmpm.physics.model import edge_inputs
from hybridmpm.training.physics.network.edges import EdgeList, SortedEdges
from hybridmpm.training.physics.network.graph_network import GraphNetwork, Layer

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

"""The graph network: encoder, processor, decoder (Sanchez-Gonzalez et al. 2020, arXiv:2002.09405)."""

from typing import Protocol

import torch
from torch import Tensor, nn

from hybridmpm.physics.spec import TYPE_EMBEDDING, TYPES, NetworkSpec


class Edges(Protocol):
    """How nodes are joined: N nodes, E edges."""

    def from_senders(self, nodes: Tensor) -> Tensor:
        """Node rows (N, H) at the sending end of each edge."""

    def from_receivers(self, nodes: Tensor) -> Tensor:
        """Node rows (N, H) at the receiving end of each edge."""

    def sum(self, edges: Tensor) -> Tensor:
        """Sum (N, H) of the edges that arrive at each node."""


class EdgeList:
    """E edges as two lists of indices: for training, where graphs of a batch differ in size.

    Parameters
    ----------
    senders, receivers : int64 (E,)
    count : int
        N.
    """

    def __init__(self, senders: Tensor, receivers: Tensor, count: int) -> None:
        self._senders, self._receivers, self._count = senders, receivers, count

    def from_senders(self, nodes: Tensor) -> Tensor:
        """Return (E, H)."""
        return nodes.index_select(0, self._senders)

    def from_receivers(self, nodes: Tensor) -> Tensor:
        """Return (E, H)."""
        return nodes.index_select(0, self._receivers)

    def sum(self, edges: Tensor) -> Tensor:
        """Return (N, H)."""
        return edges.new_zeros(self._count, edges.shape[-1]).index_add(0, self._receivers, edges)


class SortedEdges:
    """E edges ordered by receiver, and where each node finds its own: for inference.

    Nodes gather the messages that arrive, at most K, instead of edges scattering them, which onnxruntime does
    one by one. Only this table is padded: the perceptrons see each edge once.

    Parameters
    ----------
    senders, receivers : integer (E,)
    arrivals : integer (N, K)
        Edges into each node; surplus entries may name any.
    mask : bool (N, K)
        Which entries count.
    """

    def __init__(self, senders: Tensor, receivers: Tensor, arrivals: Tensor, mask: Tensor) -> None:
        self._senders, self._receivers, self._arrivals = senders, receivers, arrivals
        self._weights = mask.to(torch.float32).unsqueeze(1)

    def from_senders(self, nodes: Tensor) -> Tensor:
        """Return (E, H)."""
        return nn.functional.embedding(self._senders, nodes)

    def from_receivers(self, nodes: Tensor) -> Tensor:
        """Return (E, H)."""
        return nn.functional.embedding(self._receivers, nodes)

    def sum(self, edges: Tensor) -> Tensor:
        """Return (N, H)."""
        return torch.matmul(self._weights, nn.functional.embedding(self._arrivals, edges)).squeeze(1)


class Perceptron(nn.Module):
    """ReLU layers of one width and a linear one; takes the sum of its first maps' outputs as input."""

    def __init__(self, width: int, outputs: int, hidden_layers: int, *, norm: bool) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.ReLU()]
        for _ in range(hidden_layers - 1):
            layers += [nn.Linear(width, width), nn.ReLU()]
        layers.append(nn.Linear(width, outputs))
        if norm:
            layers.append(nn.LayerNorm(outputs))
        self.layers = nn.Sequential(*layers)

    def forward(self, first: Tensor) -> Tensor:
        """Go on from the first linear map's output (..., width) to (..., outputs)."""
        return self.layers(first)  # type: ignore[no-any-return]


class Encoder(nn.Module):
    """Features of nodes and edges to latents."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.types = nn.Embedding(TYPES, TYPE_EMBEDDING)
        self.node = nn.Linear(spec.node_features, spec.latent)
        self.edge = nn.Linear(spec.edge_features, spec.latent)
        self.node_rest = Perceptron(spec.latent, spec.latent, spec.hidden_layers, norm=True)
        self.edge_rest = Perceptron(spec.latent, spec.latent, spec.hidden_layers, norm=True)

    def forward(self, nodes: Tensor, types: Tensor, edges: Tensor) -> tuple[Tensor, Tensor]:
        """Node features (N, F), types (N,) and edge features (..., D + 1) to latents of width H."""
        known = torch.cat([nodes, self.types(types)], dim=-1)
        return self.node_rest(self.node(known)), self.edge_rest(self.edge(edges))


class Layer(nn.Module):
    """One message passing: edges from both their ends, nodes from the sum of their edges, both as residuals.

    The first map of the edges is W_e e + W_s v_s + W_r v_r: one map of the concatenation [e, v_s, v_r], with
    the node parts multiplied once a node instead of once an edge.
    """

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        width = spec.latent
        self.edge = nn.Linear(width, width)
        self.sender = nn.Linear(width, width, bias=False)
        self.receiver = nn.Linear(width, width, bias=False)
        self.edge_rest = Perceptron(width, width, spec.hidden_layers, norm=True)
        self.node = nn.Linear(2 * width, width)
        self.node_rest = Perceptron(width, width, spec.hidden_layers, norm=True)

    def forward(self, nodes: Tensor, edges: Tensor, graph: Edges) -> tuple[Tensor, Tensor]:
        """Latents of nodes (N, H) and edges (..., H) to new ones."""
        ends = graph.from_senders(self.sender(nodes)) + graph.from_receivers(self.receiver(nodes))
        message = self.edge_rest(self.edge(edges) + ends)
        update = self.node_rest(self.node(torch.cat([nodes, graph.sum(message)], dim=-1)))
        return nodes + update, edges + message


class Processor(nn.Module):
    """L layers with weights of their own."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.layers = nn.ModuleList(Layer(spec) for _ in range(spec.layers))

    def forward(self, nodes: Tensor, edges: Tensor, graph: Edges) -> Tensor:
        """Latents of nodes (N, H) after the last layer."""
        for layer in self.layers:
            nodes, edges = layer(nodes, edges, graph)
        return nodes


class Decoder(nn.Module):
    """Node latents to numbers, without LayerNorm: a normalised acceleration would lose its size."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.node = nn.Linear(spec.latent, spec.latent)
        self.node_rest = Perceptron(spec.latent, spec.dim, spec.hidden_layers, norm=False)

    def forward(self, nodes: Tensor) -> Tensor:
        """(N, H) to (N, D)."""
        return self.node_rest(self.node(nodes))  # type: ignore[no-any-return]


class GraphNetwork(nn.Module):
    """Encoder, processor, decoder: features of a graph to normalised accelerations."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.encoder = Encoder(spec)
        self.processor = Processor(spec)
        self.decoder = Decoder(spec)

    def forward(self, nodes: Tensor, types: Tensor, edges: Tensor, graph: Edges) -> Tensor:
        """Node features (N, F), types (N,), edge features (..., D + 1) to accelerations (N, D)."""
        return self.decoder(self.processor(*self.encoder(nodes, types, edges), graph))  # type: ignore[no-any-return]

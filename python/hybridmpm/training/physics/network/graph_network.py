"""The graph network: encoder, processor, decoder (Sanchez-Gonzalez et al. 2020, arXiv:2002.09405)."""

import torch
from torch import Tensor, nn

from hybridmpm.physics.spec import TYPE_EMBEDDING, TYPES, NetworkSpec
from hybridmpm.training.physics.network.edges import Edges
from hybridmpm.training.physics.network.grid_branch import GridBranch


class Perceptron(nn.Module):
    """Hidden ReLU layers of one width and a linear output layer.

    The first linear map is outside, because its output may be a sum of several maps. This sum is the input.
    """

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
        """Return the outputs (..., outputs) for the output (..., width) of the first linear map."""
        return self.layers(first)  # type: ignore[no-any-return]


class Encoder(nn.Module):
    """Turns features of nodes and edges into latent vectors.

    Parameters
    ----------
    spec : NetworkSpec
    extra : int
        Number of features of a node besides those of the simulator.
    """

    def __init__(self, spec: NetworkSpec, extra: int = 0) -> None:
        super().__init__()
        self.types = nn.Embedding(TYPES, TYPE_EMBEDDING)
        self.node = nn.Linear(spec.node_features + extra, spec.latent)
        self.edge = nn.Linear(spec.edge_features, spec.latent)
        self.node_rest = Perceptron(spec.latent, spec.latent, spec.hidden_layers, norm=True)
        self.edge_rest = Perceptron(spec.latent, spec.latent, spec.hidden_layers, norm=True)

    def forward(self, nodes: Tensor, types: Tensor, edges: Tensor) -> tuple[Tensor, Tensor]:
        """Return latents (N, H), (..., H) of node features (N, F) with types (N,) and of edge features."""
        features = torch.cat([nodes, self.types(types)], dim=-1)
        return self.node_rest(self.node(features)), self.edge_rest(self.edge(edges))


class Layer(nn.Module):
    """One step of message passing.

    An edge is updated from itself and both its ends, then a node from itself and the sum of its edges. Both
    updates are added to the old values.

    The first map of an edge is W_e e + W_s v_s + W_r v_r, which is one map of the concatenation
    [e, v_s, v_r]. In this form the parts of a node are computed once, not once for each of its edges.
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
        """Return the new latents of nodes (N, H) and edges (..., H)."""
        ends = graph.from_senders(self.sender(nodes)) + graph.from_receivers(self.receiver(nodes))
        message = self.edge_rest(self.edge(edges) + ends)
        update = self.node_rest(self.node(torch.cat([nodes, graph.sum(message)], dim=-1)))
        return nodes + update, edges + message


class Processor(nn.Module):
    """L layers of message passing, each with its own weights."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.layers = nn.ModuleList(Layer(spec) for _ in range(spec.layers))

    def forward(self, nodes: Tensor, edges: Tensor, graph: Edges) -> Tensor:
        """Return the latents (N, H) of the nodes after the last layer."""
        for layer in self.layers:
            nodes, edges = layer(nodes, edges, graph)
        return nodes


class Decoder(nn.Module):
    """Turns latents of nodes into accelerations; a LayerNorm at the end would take away their size."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.node = nn.Linear(spec.latent, spec.latent)
        self.node_rest = Perceptron(spec.latent, spec.dim, spec.hidden_layers, norm=False)

    def forward(self, nodes: Tensor) -> Tensor:
        """Return normalised accelerations (N, D) of latents (N, H)."""
        return self.node_rest(self.node(nodes))  # type: ignore[no-any-return]


class GraphNetwork(nn.Module):
    """Encoder, processor and decoder, which turn features of a graph into normalised accelerations.

    A grid branch, if the network has one, adds to the latents of the nodes before the processor.
    """

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.encoder = Encoder(spec)
        self.grid = GridBranch(spec) if spec.grid_cells else None
        self.processor = Processor(spec)
        self.decoder = Decoder(spec)

    def forward(self, x: Tensor, nodes: Tensor, types: Tensor, edges: Tensor, graph: Edges) -> Tensor:
        """Return normalised accelerations (N, D).

        Inputs are positions (N, D) [m], node features (N, F), types (N,) and edge features (..., D + 1).
        """
        latents, messages = self.encoder(nodes, types, edges)
        if self.grid is not None:
            latents = latents + self.grid(latents, x, graph)
        return self.decoder(self.processor(latents, messages, graph))  # type: ignore[no-any-return]

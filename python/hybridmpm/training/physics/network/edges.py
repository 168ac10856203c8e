"""The edges of a graph: a protocol, and its forms for training and for inference."""

from collections.abc import Sequence
from typing import Protocol

import torch
from torch import Tensor, nn


class Edges(Protocol):
    """The E edges between N nodes."""

    def from_senders(self, nodes: Tensor) -> Tensor:
        """Return the rows (E, H) of `nodes` (N, H) at the sending ends of the edges."""

    def from_receivers(self, nodes: Tensor) -> Tensor:
        """Return the rows (E, H) of `nodes` (N, H) at the receiving ends of the edges."""

    def sum(self, edges: Tensor) -> Tensor:
        """Return, for each node, the sum of the rows of `edges` (E, H) that arrive at it, (N, H)."""

    def split(self, nodes: Tensor) -> Sequence[Tensor]:
        """Return the rows of `nodes` (N, H) of each scene; scenes of a batch share no edge."""


class EdgeList:
    """E edges as two lists of indices, for training, where the graphs of a batch differ in size.

    Parameters
    ----------
    senders, receivers : int64 (E,)
        Indices of the nodes at both ends of each edge.
    counts : sequence of int
        Number of nodes of each scene, N in all.
    """

    def __init__(self, senders: Tensor, receivers: Tensor, counts: Sequence[int]) -> None:
        self._senders, self._receivers, self._counts = senders, receivers, list(counts)

    def from_senders(self, nodes: Tensor) -> Tensor:
        """Return the rows (E, H) of nodes; see `Edges`."""
        return nodes.index_select(0, self._senders)

    def from_receivers(self, nodes: Tensor) -> Tensor:
        """Return the rows (E, H) of nodes; see `Edges`."""
        return nodes.index_select(0, self._receivers)

    def sum(self, edges: Tensor) -> Tensor:
        """Return the sums (N, H) of edges; see `Edges`."""
        return edges.new_zeros(sum(self._counts), edges.shape[-1]).index_add(0, self._receivers, edges)

    def split(self, nodes: Tensor) -> Sequence[Tensor]:
        """Return the rows of each scene; see `Edges`."""
        return torch.split(nodes, self._counts)


class SortedEdges:
    """E edges ordered by receiver, with a table of the edges that arrive at each node, for inference.

    Each node gathers the messages of up to K edges. If edges scattered their messages instead, onnxruntime
    would take them one by one. Only the table is padded; the perceptrons compute each edge once.

    Parameters
    ----------
    senders, receivers : integer (E,)
        Indices of the nodes at both ends of each edge.
    arrivals : integer (N, K)
        Indices of the edges that arrive at each node; surplus entries may be any index.
    mask : bool (N, K)
        Whether an entry of `arrivals` is an edge and not surplus.
    """

    def __init__(self, senders: Tensor, receivers: Tensor, arrivals: Tensor, mask: Tensor) -> None:
        self._senders, self._receivers, self._arrivals = senders, receivers, arrivals
        self._weights = mask.to(torch.float32).unsqueeze(1)

    def from_senders(self, nodes: Tensor) -> Tensor:
        """Return the rows (E, H) of nodes; see `Edges`."""
        return nn.functional.embedding(self._senders, nodes)

    def from_receivers(self, nodes: Tensor) -> Tensor:
        """Return the rows (E, H) of nodes; see `Edges`."""
        return nn.functional.embedding(self._receivers, nodes)

    def sum(self, edges: Tensor) -> Tensor:
        """Return the sums (N, H) of edges; see `Edges`."""
        return torch.matmul(self._weights, nn.functional.embedding(self._arrivals, edges)).squeeze(1)

    def split(self, nodes: Tensor) -> Sequence[Tensor]:
        """Return the rows of the only scene; see `Edges`."""
        return (nodes,)

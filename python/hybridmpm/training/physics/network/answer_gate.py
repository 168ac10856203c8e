"""The gate of a network's answer: particles of an undisturbed body fall freely and need no network."""

import torch
from torch import Tensor

from hybridmpm.physics.answer_gate import MOST, QUIET, UNNOTICED
from hybridmpm.training.physics.network.edges import Edges


def answer_weights(
    history: Tensor,
    known_step: Tensor,
    walls: Tensor,
    graph: Edges,
    *,
    radius: float,
    scale: Tensor,
    hops: int,
) -> Tensor:
    """Return the weight (N, 1) in [0, 1] with which the network's answer counts beside free fall.

    A particle is disturbed where it is near a wall, has lately accelerated otherwise than by the known
    acceleration, or moves relative to a neighbour. The weight is 0 where no particle within `hops` edges is
    disturbed. The network's answer depends only on particles within as many edges as it has layers, so with
    `hops` equal to the number of layers no disturbance that it could use is lost.

    Parameters
    ----------
    history : (6, N, D)
        Positions [m], oldest first.
    known_step : (N, D)
        Known acceleration [m per step^2].
    walls : (2, D) or (2, N, D)
        Lower and upper corner of the walls [m].
    graph : Edges
        Pairs of neighbours at the latest positions.
    radius : float
        Connectivity radius R [m].
    scale : (D,)
        Standard deviation of the acceleration [m per step^2].
    hops : int
        Number of edges that a disturbance spreads over.
    """
    velocity = history[1:] - history[:-1]
    ahead = history[-1] + velocity[-1] + known_step
    departure = ((velocity[1:] - velocity[:-1] - known_step) / scale).square().sum(dim=(0, -1))
    against = ((graph.from_senders(velocity[-1]) - graph.from_receivers(velocity[-1])) / scale).square()
    signal = (departure + _near(history[-1], walls, radius) + _near(ahead, walls, radius)).unsqueeze(-1)
    signal = torch.relu(signal + graph.sum(against.sum(dim=-1, keepdim=True)) - UNNOTICED)
    for _ in range(hops):
        signal = (signal + graph.sum(graph.from_senders(signal))).clamp(max=MOST)
    return 1.0 - torch.exp(-signal / QUIET)


def _near(x: Tensor, walls: Tensor, radius: float) -> Tensor:
    """Return the sum (N,) over the walls of 1 - distance / radius, as far as this is positive."""
    distance = torch.cat([x - walls[0], walls[1] - x], dim=-1) / radius
    return torch.relu(1.0 - distance).sum(dim=-1)

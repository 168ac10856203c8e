"""Which particles anything happens to: those of an undisturbed body fall freely, and need no network."""

import torch
from torch import Tensor

from hybridmpm.physics.answer_gate import MOST, QUIET, UNNOTICED
from hybridmpm.training.physics.graph_network import Edges


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
    """Return the weight (N, 1) in [0, 1] of the network's answer at each particle.

    It is 0 where no particle within `hops` edges is near a wall, has lately accelerated otherwise than the
    known acceleration says, or moves against a neighbour. With as many hops as the network has layers these
    are all that its answer depends on, so nothing that it could know is lost.

    Parameters
    ----------
    history : (6, N, D)
        Positions [m], oldest first.
    known_step : (N, D)
        Known acceleration [m per step^2].
    walls : (2, D) or (2, N, D)
        Lower and upper corner [m].
    graph : Edges
    radius : float
        R [m].
    scale : (D,)
        Standard deviation of the acceleration [m per step^2].
    hops : int
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
    """Sum over walls of how far within the radius they are, (N,)."""
    distance = torch.cat([x - walls[0], walls[1] - x], dim=-1) / radius
    return torch.relu(1.0 - distance).sum(dim=-1)

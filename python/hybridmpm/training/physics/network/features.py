"""Features of particles and edges, the inputs of the network; exported models contain these operations."""

import torch
from torch import Tensor

from hybridmpm.training.physics.network.edges import Edges

_SMALLEST = 1e-12
"""Number added to a squared length, so that its root has a gradient also for coincident particles."""


def step_velocities(history: Tensor) -> Tensor:
    """Return the velocities (5, N, D) [m per step] of positions (6, N, D) [m], oldest first."""
    return history[1:] - history[:-1]


def node_features(
    history: Tensor, walls: Tensor, radius: float, velocity_mean: Tensor, velocity_std: Tensor
) -> Tensor:
    """Return normalised velocities, and distances to the walls over the radius, clipped to [-1, 1].

    Parameters
    ----------
    history : (6, N, D)
        Positions [m], oldest first.
    walls : (2, D) or (2, N, D)
        Lower and upper corner of the walls [m].
    radius : float
        Connectivity radius R [m].
    velocity_mean, velocity_std : (D,)
        Mean and standard deviation of the velocity [m per step].

    Returns
    -------
    (N, 5 D + 2 D)
        The velocities from the oldest to the latest, then the distances to lower and to upper walls.
    """
    velocity = (step_velocities(history) - velocity_mean) / velocity_std
    x = history[-1]
    distance = torch.cat([x - walls[0], walls[1] - x], dim=-1) / radius
    return torch.cat([*velocity.unbind(0), distance.clamp(-1.0, 1.0)], dim=-1)


def edge_features(x: Tensor, graph: Edges, radius: float) -> Tensor:
    """Return the displacement from receiver to sender and its length, both over the radius, (..., D + 1).

    Parameters
    ----------
    x : (N, D)
        Positions [m].
    graph : Edges
        Pairs of neighbours.
    radius : float
        Connectivity radius R [m].
    """
    offset = (graph.from_senders(x) - graph.from_receivers(x)) / radius
    length = ((offset * offset).sum(dim=-1, keepdim=True) + _SMALLEST).sqrt()
    return torch.cat([offset, length], dim=-1)

"""Relaxation of density after a network step, as in Neural SPH (Toshev et al. 2024, arXiv:2402.06275).

Particles that a step has crowded together push each other apart, along the edges that the network used. This
is the form with gradients, for training. Models are served with the compiled `hybridmpm._native.relaxed`; a
test compares both.
"""

import torch
from torch import Tensor

from hybridmpm.physics.relaxation import STRENGTH
from hybridmpm.training.physics.network.edges import Edges

_SMALLEST = 1e-12


def relaxation(x: Tensor, graph: Edges, radius: float, rest: float) -> Tensor:
    """Return displacements (N, D) [m] that lower densities above the density at rest, and no others.

    The kernel of the density at a distance d is (1 - d/R)^2. The particles of a pair move apart by equal and
    opposite displacements, in proportion to the sum of their excess densities and to the kernel's slope. This
    keeps momentum, except at kinematic particles.

    Parameters
    ----------
    x : (N, D)
        Positions [m].
    graph : Edges
        Pairs of particles that may be near each other; pairs beyond the radius do not act.
    radius : float
        Connectivity radius R [m].
    rest : float
        Density at rest, `hybridmpm.physics.relaxation.rest_density`.
    """
    offset = (graph.from_senders(x) - graph.from_receivers(x)) / radius
    length = ((offset * offset).sum(dim=-1, keepdim=True) + _SMALLEST).sqrt()
    near = torch.relu(1.0 - length)
    excess = torch.relu(graph.sum(near * near) / rest - 1.0)
    push = (graph.from_senders(excess) + graph.from_receivers(excess)) * near
    return graph.sum(-push * offset / length) * (0.5 * STRENGTH * radius)

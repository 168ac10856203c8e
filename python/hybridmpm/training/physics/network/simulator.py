"""`LearnedSimulator`: one step of r_t frames, from the last six positions to the next ones."""

import torch
from torch import Tensor, nn

from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.scene.particle_types import KINEMATIC
from hybridmpm.training.physics.network.answer_gate import answer_weights
from hybridmpm.training.physics.network.edges import Edges
from hybridmpm.training.physics.network.features import edge_features, node_features
from hybridmpm.training.physics.network.graph_network import GraphNetwork


class LearnedSimulator(nn.Module):
    """A graph network with its features, scales and integrator.

    The network predicts the residual acceleration: the acceleration without the known one, which is gravity
    and the external acceleration. So a network that answers zero is free fall between walls.
    """

    velocity_mean: Tensor
    velocity_std: Tensor
    acceleration_mean: Tensor
    acceleration_std: Tensor

    def __init__(self, spec: NetworkSpec, scales: Normalization) -> None:
        super().__init__()
        self.spec, self.scales = spec, scales
        self.network = GraphNetwork(spec)
        for name in ("velocity_mean", "velocity_std", "acceleration_mean", "acceleration_std"):
            self.register_buffer(name, torch.tensor(getattr(scales, name), dtype=torch.float32))

    def answer(self, history: Tensor, types: Tensor, walls: Tensor, graph: Edges) -> Tensor:
        """Return the network's answer, normalised residual accelerations (N, D); inputs as in `forward`."""
        radius = self.spec.radius
        nodes = node_features(history, walls, radius, self.velocity_mean, self.velocity_std)
        edges = edge_features(history[-1], graph, radius)
        prediction: Tensor = self.network(history[-1], nodes, types, edges, graph)
        return prediction

    def forward(
        self, history: Tensor, types: Tensor, acceleration: Tensor, walls: Tensor, graph: Edges
    ) -> Tensor:
        """Return positions (N, D) [m] one step later, within the walls; kinematic particles stay.

        Parameters
        ----------
        history : (6, N, D)
            Positions [m], one step apart, oldest first.
        types : int64 (N,)
            DeepMind's particle types.
        acceleration : (N, D)
            Known acceleration [m/s^2], gravity included, constant over the step.
        walls : (2, D) or (2, N, D)
            Lower and upper corner of the walls [m].
        graph : Edges
            Pairs of neighbours at the latest positions.
        """
        answer = self.answer(history, types, walls, graph)
        return self.integrate(history, types, acceleration, walls, graph, answer=answer)

    def integrate(
        self,
        history: Tensor,
        types: Tensor,
        acceleration: Tensor,
        walls: Tensor,
        graph: Edges,
        *,
        answer: Tensor,
    ) -> Tensor:
        """Return positions (N, D) [m] after the Euler step of an answer (N, D)."""
        weight = self.answer_weights(history, types, acceleration, walls, graph)
        return self.moved(history, types, acceleration, walls, answer=answer, weight=weight)

    def moved(
        self,
        history: Tensor,
        types: Tensor,
        acceleration: Tensor,
        walls: Tensor,
        *,
        answer: Tensor,
        weight: Tensor,
    ) -> Tensor:
        """Return positions (N, D) [m] after the Euler step of an answer (N, D) with its weight (N, 1)."""
        start = history[-1]
        residual = answer * self.acceleration_std + self.acceleration_mean
        x = start + (start - history[-2]) + acceleration * self.spec.step_dt**2 + weight * residual
        return torch.where(_still(types), start, within(x, walls))

    def answer_weights(
        self, history: Tensor, types: Tensor, acceleration: Tensor, walls: Tensor, graph: Edges
    ) -> Tensor:
        """Return the weight (N, 1) in [0, 1] of the answer; parameters as in `forward`.

        The weight is 0 for kinematic particles and where nothing happens to a body, since an undisturbed one
        falls freely. Served models get it from `hybridmpm.physics.answer_gate`.
        """
        found = answer_weights(
            history,
            acceleration * self.spec.step_dt**2,
            walls,
            graph,
            radius=self.spec.radius,
            scale=self.acceleration_std,
            hops=self.spec.layers,
        )
        return torch.where(_still(types), 0.0, found)


def _still(types: Tensor) -> Tensor:
    return (types == KINEMATIC).unsqueeze(-1)


def within(x: Tensor, walls: Tensor) -> Tensor:
    """Return positions x (N, D), those outside the walls (2, D) or (2, N, D) moved onto them."""
    return torch.maximum(torch.minimum(x, walls[1]), walls[0])

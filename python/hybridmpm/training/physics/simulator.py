"""`LearnedSimulator`: one step of r_t frames, from six positions to the next one."""

import torch
from torch import Tensor, nn

from hybridmpm.physics.relaxation import rest_density
from hybridmpm.physics.spec import NetworkSpec, Normalization
from hybridmpm.scene.particle_types import KINEMATIC
from hybridmpm.training.physics.answer_gate import answer_weights
from hybridmpm.training.physics.features import edge_features, node_features
from hybridmpm.training.physics.graph_network import Edges, GraphNetwork
from hybridmpm.training.physics.relaxation import relaxation


class LearnedSimulator(nn.Module):
    """A graph network with its features, scales and integrator.

    The network predicts the acceleration that is left once the known one, gravity and external, is taken out.
    A network that answers zero therefore is free fall between walls.
    """

    velocity_mean: Tensor
    velocity_std: Tensor
    acceleration_mean: Tensor
    acceleration_std: Tensor

    def __init__(self, spec: NetworkSpec, scales: Normalization) -> None:
        super().__init__()
        self.spec, self.scales = spec, scales
        self.network = GraphNetwork(spec)
        self._rest = rest_density(spec)
        for name in ("velocity_mean", "velocity_std", "acceleration_mean", "acceleration_std"):
            self.register_buffer(name, torch.tensor(getattr(scales, name), dtype=torch.float32))

    def answer(self, history: Tensor, types: Tensor, walls: Tensor, graph: Edges) -> Tensor:
        """Normalised acceleration (N, D) that the network predicts; arguments as in `forward`."""
        radius = self.spec.radius
        nodes = node_features(history, walls, radius, self.velocity_mean, self.velocity_std)
        prediction: Tensor = self.network(nodes, types, edge_features(history[-1], graph, radius), graph)
        return prediction

    def forward(
        self, history: Tensor, types: Tensor, acceleration: Tensor, walls: Tensor, graph: Edges
    ) -> Tensor:
        """Positions (N, D) [m] one step later, within the walls; kinematic particles stay.

        Parameters
        ----------
        history : (6, N, D)
            Positions [m], one step apart, oldest first.
        types : int64 (N,)
            DeepMind's particle types.
        acceleration : (N, D)
            Known acceleration [m/s^2], gravity among it, held over the step.
        walls : (2, D) or (2, N, D)
            Lower and upper corner [m].
        graph : Edges
            Of the latest positions.
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
        """Take the Euler step of a network's answer (N, D), and relax densities."""
        weight = self.answer_weights(history, types, acceleration, walls, graph)
        x = self.moved(history, types, acceleration, walls, answer=answer, weight=weight)
        for _ in range(self.spec.relaxations):
            relaxed = within(x + weight * relaxation(x, graph, self.spec.radius, self._rest), walls)
            x = torch.where(weight > 0.0, relaxed, x)
        return x

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
        """Take the Euler step of the answer (N, D) with its weight (N, 1); returns positions (N, D) [m]."""
        start = history[-1]
        residual = answer * self.acceleration_std + self.acceleration_mean
        x = start + (start - history[-2]) + acceleration * self.spec.step_dt**2 + weight * residual
        return torch.where(_still(types), start, within(x, walls))

    def answer_weights(
        self, history: Tensor, types: Tensor, acceleration: Tensor, walls: Tensor, graph: Edges
    ) -> Tensor:
        """Return the weight (N, 1) of the answer and of relaxation, 0 for kinematic particles.

        They count only where something happens to a body: an undisturbed one falls freely. Served models
        have it from `hybridmpm.physics.answer_gate`.
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
    """Move what is outside the walls (2, D) or (2, N, D) onto them."""
    return torch.maximum(torch.minimum(x, walls[1]), walls[0])

"""`ControlNetTrainer`: a Fluid ControlNet in training."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor, nn

from hybridmpm.control.diffusion.schedule import TRAINING_STEPS, cosine_schedule
from hybridmpm.physics.spec import NetworkSpec
from hybridmpm.training.control.controlnet.cases import FRAMES, NodeCase
from hybridmpm.training.control.controlnet.network import FluidControlNet, fluid_moments
from hybridmpm.training.control.controlnet.ways import WAY, way_of
from hybridmpm.training.control.controlnet.windows import Batch, drawn, plain
from hybridmpm.training.physics.network.edges import Edges
from hybridmpm.training.physics.network.features import edge_features, node_features
from hybridmpm.training.run import VALIDATION, log_row
from hybridmpm.training.settings import ControlNetSettings
from hybridmpm.training.trainable import Trainable, adam_w

_AT_NOISE = 0.6
"""Share of the samples at the last time of the diffusion, from which all samplers begin."""
_AT_REST = 0.05
"""Least mean square of the ways, in squares of `WAY`, to which an error is relative."""
_SMALL = 0.02
"""The same for the mean way of all nodes."""
_SPEED = 1.0
"""Velocity that is one in the features [m/s]."""


class Conditioned(nn.Module):
    """The network with its features, from positions and velocities of control nodes.

    Parameters
    ----------
    spec : NetworkSpec
        Size, radius and scenarios.
    """

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.spec = spec
        self.network = FluidControlNet(spec)

    def forward(
        self,
        x: Tensor,
        v: Tensor,
        types: Tensor,
        walls: Tensor,
        graph: Edges,
        *,
        noisy: Tensor,
        step: Tensor,
        condition: Tensor,
        of_graph: Tensor | None = None,
    ) -> Tensor:
        """Return the predicted displacement of each node (N, D) over `WAY`.

        The clean field x_0 follows from that by `ways.field_of`. The five velocities of the simulator's
        features are all the present one: control has no past, so that it continues from any state.

        Parameters
        ----------
        x, v : (N, D)
            Positions [m] and velocities [m/s].
        types : int64 (N,)
            Particle types.
        walls : (2, D) or (2, N, D)
            Lower and upper corner of the walls [m].
        graph : Edges
            Pairs of neighbours.
        noisy, step, condition
            As `FluidControlNet.forward` takes them.
        of_graph : int64 (N,), optional
            Graph of each node; one graph if absent.
        """
        radius = self.spec.radius
        back = torch.arange(5, -1, -1, dtype=x.dtype, device=x.device).reshape(-1, 1, 1)
        unit = torch.ones(self.spec.dim, dtype=x.dtype, device=x.device)
        history = x - back * (v / _SPEED)
        nodes = node_features(history, walls, radius, torch.zeros_like(unit), unit)
        edges = edge_features(x, graph, radius)
        places = 2.0 * x - 1.0
        return self.network(  # type: ignore[no-any-return]
            nodes,
            types,
            edges,
            graph,
            places=places,
            fluid=fluid_moments(places, v / _SPEED, of_graph),
            noisy=noisy,
            step=step,
            condition=condition,
        )


class ControlNetTrainer(Trainable[Conditioned]):
    """Training by diffusion: the network predicts the clean field from a noisy one.

    The network predicts the ways of which the field is made, not the field itself: see `ways.field_of`.
    So it need not learn how a body is braked and held. An error counts by the distance that it leads astray:
    early in the time an error of the acceleration leads much farther than late.

    The loss of a sample is the root mean square error of where the nodes are led, over that of how far they
    have to go, at least `_AT_REST`. Two terms are added: the same for the mean over all nodes, which a
    sketch determines best, and the relative error of the covariance of the nodes' ends. Without the
    covariance the network predicts the mean of all possible ends, which leaves a fluid too little room.

    Parameters
    ----------
    spec : NetworkSpec
    settings : ControlNetSettings
    scale : float
        Root mean square of the data's accelerations along an axis [m/s^2].
    """

    kind: ClassVar[str] = "controlnet"

    def __init__(self, spec: NetworkSpec, settings: ControlNetSettings, scale: float) -> None:
        torch.manual_seed(settings.seed)
        self.spec, self.settings, self.scale = spec, settings, scale
        self._kept = torch.from_numpy(cosine_schedule().astype(np.float32))
        network = Conditioned(spec)
        super().__init__(network, settings, adam_w(network, settings), Conditioned(spec))

    def step(self, cases: Sequence[NodeCase]) -> float:
        """Take one training step on frames of some cases, and return the loss before it.

        Raises
        ------
        FloatingPointError
            The loss is not finite; the weights have not changed.
        """
        size = self.settings.batch
        batch = drawn(self._rng, cases, size, self.spec.radius)
        time = self._rng.integers(1, TRAINING_STEPS, size, endpoint=True)
        time[self._rng.random(size) < _AT_NOISE] = TRAINING_STEPS
        noise = torch.from_numpy(self._rng.standard_normal(batch.force.shape, dtype=np.float32))
        return self._descend(self.loss(batch, torch.from_numpy(time), noise))

    def loss(self, batch: Batch, time: Tensor, noise: Tensor) -> Tensor:
        """Return the mean loss of a batch at times (B,) of the diffusion, for normal numbers (N, D)."""
        way = way_of(batch.force, batch.v, batch.step, batch.seconds, batch.gravity) / WAY
        error = self._answer(self.network, batch, time, noise) - way
        miss, size = self._means(error, batch), self._means(way, batch)
        whole, wanted = (self._whole(field, batch).square().sum(dim=-1) for field in (error, way))
        parts = (miss / (size + _AT_REST), whole / (wanted + _SMALL))
        relative = torch.stack([(part + 1e-8).sqrt().mean() for part in parts]).sum()
        end = batch.x / WAY + way
        spread, true = self._spread(end + error, batch), self._spread(end, batch)
        wide = (spread - true).square().sum(dim=(1, 2)) / (true.square().sum(dim=(1, 2)) + 1e-8)
        return relative + (wide + 1e-8).sqrt().mean()

    def unexplained(self, cases: Sequence[NodeCase]) -> float:
        """Return the mean square of what one evaluation leaves unexplained, over that of the ways [-].

        Four frames of each case count, from the same noise in each call.
        """
        total = torch.zeros(2)
        for step in range(0, FRAMES, FRAMES // 4):
            batch = plain(cases, step, self.spec.radius)
            noise = torch.from_numpy(
                np.random.default_rng(step).standard_normal(batch.force.shape, dtype=np.float32)
            )
            time = torch.full((len(cases),), TRAINING_STEPS)
            with torch.no_grad():
                way = way_of(batch.force, batch.v, batch.step, batch.seconds, batch.gravity) / WAY
                error = self._answer(self.average, batch, time, noise) - way
            total += torch.stack([self._means(field, batch).sum() for field in (error, way)])
        return float(total[0] / total[1])

    def _answer(self, network: Conditioned, batch: Batch, time: Tensor, noise: Tensor) -> Tensor:
        """Return the displacements (N, D) that a network predicts from noisy fields at times (B,)."""
        kept = self._kept[time][batch.of_graph, None]
        noisy = kept.sqrt() * batch.force / self.scale + (1 - kept).sqrt() * noise
        condition = network.network.condition(batch.pictures, time)[batch.of_graph]
        answer: Tensor = network(
            batch.x,
            batch.v,
            batch.types,
            batch.walls,
            batch.edges,
            noisy=noisy,
            step=batch.step,
            condition=condition,
            of_graph=batch.of_graph,
        )
        return answer

    @staticmethod
    def _whole(field: Tensor, batch: Batch) -> Tensor:
        """Return the mean of a field (N, D) over each graph (B, D)."""
        graphs = len(batch.pictures)
        total = torch.zeros(graphs, field.shape[1]).index_add(0, batch.of_graph, field)
        return total / torch.bincount(batch.of_graph, minlength=graphs)[:, None]

    def _spread(self, places: Tensor, batch: Batch) -> Tensor:
        """Return the covariance (B, D, D) of places (N, D) in each graph."""
        away = places - self._whole(places, batch)[batch.of_graph]
        products = away[:, :, None] * away[:, None, :]
        return self._whole(products.flatten(1), batch).reshape(-1, *products.shape[1:])

    @staticmethod
    def _means(field: Tensor, batch: Batch) -> Tensor:
        """Return the mean square (B,) of a field (N, D) over each graph."""
        graphs = len(batch.pictures)
        square = field.square().sum(dim=-1)
        total = torch.zeros(graphs).index_add(0, batch.of_graph, square)
        return total / torch.bincount(batch.of_graph, minlength=graphs)

    def state(self) -> dict[str, Any]:
        """Return the state that `load` needs, as tensors and plain data."""
        return self._state(self.spec.to_dict()) | {"scale": self.scale}

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the trainer of a checkpoint, to continue the training.

        Raises
        ------
        DataError
            `checkpoint.read` refuses the file, or it is the checkpoint of another network.
        ConfigError
            The network has other features than those of this library; the message names both versions.
        """
        state = cls.checked(path)
        spec = NetworkSpec.from_dict(json.loads(state["spec"]), where=str(path))
        settings = ControlNetSettings(**json.loads(state["settings"]))
        return cls(spec, settings, float(state["scale"])).restored(state, path)


def log_unexplained(
    trainer: ControlNetTrainer, folder: Path, groups: Mapping[str, Sequence[NodeCase]]
) -> None:
    """Add to `validation.jsonl` `ControlNetTrainer.unexplained` for arrows and ovals of each scenario.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    row = {}
    for scenario, cases in groups.items():
        for kind, arrow in (("arrow", True), ("oval", False)):
            of_kind = [case for case in cases if case.is_arrow is arrow]
            if of_kind:
                row[f"{scenario}_{kind}"] = trainer.unexplained(of_kind)
    log_row(folder / VALIDATION, {"step": trainer.step_count, "seconds": trainer.seconds, **row})

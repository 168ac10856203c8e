"""Exporting the Fluid ControlNet of a checkpoint as one ONNX file; serving it needs no torch."""

from pathlib import Path

import torch
from torch import Tensor, nn

from hybridmpm._support.networks import to_properties
from hybridmpm.control.diffusion.network import FORMAT, INPUTS, OUTPUT, SIDE, ControlNetwork
from hybridmpm.training.control.controlnet.cases import FRAMES
from hybridmpm.training.control.controlnet.trainer import Conditioned, ControlNetTrainer
from hybridmpm.training.control.controlnet.ways import WAY, field_of
from hybridmpm.training.onnx_program import exported
from hybridmpm.training.physics.network.edges import SortedEdges
from hybridmpm.training.publish import Exported, parameters_of, training_record


class _Served(nn.Module):
    """The network with its graph as separate inputs, which are named as in files."""

    walls: Tensor
    gravity: Tensor
    seconds: Tensor

    def __init__(self, conditioned: Conditioned, scale: float) -> None:
        super().__init__()
        self.conditioned, self.scale = conditioned, scale
        trained = conditioned.spec.trained_on
        self.register_buffer("walls", torch.tensor(conditioned.spec.bounds).T.contiguous())
        self.register_buffer("gravity", torch.tensor(trained.gravity, dtype=torch.float32))
        self.register_buffer("seconds", torch.tensor(FRAMES * trained.frame_dt))

    def forward(  # noqa: PLR0917 - the exporter names inputs by their place
        self,
        x: Tensor,
        v: Tensor,
        types: Tensor,
        senders: Tensor,
        receivers: Tensor,
        arrivals: Tensor,
        mask: Tensor,
        noisy: Tensor,
        step: Tensor,
        picture: Tensor,
        time: Tensor,
    ) -> Tensor:
        graph = SortedEdges(senders, receivers, arrivals, mask)
        condition = self.conditioned.network.condition(picture, time)
        answer: Tensor = self.conditioned(
            x, v, types, self.walls, graph, noisy=noisy, step=step, condition=condition
        )
        return field_of(WAY * answer, v, step, self.seconds, self.gravity) / self.scale


def export_controlnet(path: Path) -> Exported:
    """Return the network of a checkpoint with its averaged weights as an ONNX model, and its training.

    Raises
    ------
    DataError
        `checkpoint.read` refuses the file, or it is the checkpoint of another network.
    ConfigError
        The network has other features than those of this library; the message names both versions.
    """
    trainer = ControlNetTrainer.load(path)
    training, count = training_record(path), parameters_of(trainer.average)
    properties = to_properties(
        FORMAT,
        spec=trainer.spec.to_dict(),
        scale=trainer.scale,
        frames=FRAMES,
        training=training | {"parameters": str(count)},
    )
    return Exported(
        data=to_onnx(trainer.average, trainer.scale, properties),
        training=training,
        parameters=count,
        folder=ControlNetwork.FOLDER,
        rows={
            "answers": "the accelerations of control nodes in a frame, given a sketch",
            "parameters": str(count),
        },
        entry={"dim": trainer.spec.dim},
        errors="See `docs/results/control.md`, method `controlnet`.",
    )


def to_onnx(network: Conditioned, scale: float, properties: dict[str, str]) -> bytes:
    """Return a network as an ONNX model that answers fields over `scale` [m/s^2].

    The number of nodes and their edges are free.
    """
    count, dim = 3, network.spec.dim
    example = (
        torch.rand(count, dim),
        torch.zeros(count, dim),
        torch.zeros(count, dtype=torch.int64),
        torch.tensor([1, 0], dtype=torch.int32),
        torch.tensor([0, 1], dtype=torch.int32),
        torch.tensor([[0, 1], [1, 1], [1, 1]], dtype=torch.int32),
        torch.tensor([[True, False], [True, False], [False, False]]),
        torch.zeros(count, dim),
        torch.zeros(count, 1),
        torch.zeros(1, 3, SIDE, SIDE),
        torch.tensor([1]),
    )
    free = torch.export.Dim.DYNAMIC
    sizes = {name: {0: free} for name in INPUTS} | {"picture": {}, "time": {}}
    sizes |= {"arrivals": {0: free, 1: free}, "mask": {0: free, 1: free}}
    return exported(
        _Served(network, scale).eval(),
        example,
        inputs=INPUTS,
        outputs=[OUTPUT],
        dynamic_shapes=sizes,
        properties=properties,
    )

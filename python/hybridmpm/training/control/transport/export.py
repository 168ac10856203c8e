"""Exporting the transport network of a checkpoint as one ONNX file; serving it needs no torch."""

from pathlib import Path

import torch

from hybridmpm._support.networks import to_properties
from hybridmpm.control.methods.learned.features import PLANES, channels, numbers, of_particle
from hybridmpm.control.methods.learned.network import FORMAT, INPUTS, OUTPUT
from hybridmpm.control.methods.learned.network import TransportNetwork as ServedNetwork
from hybridmpm.control.methods.learned.spec import CELLS, TransportSpec
from hybridmpm.training.control.transport.network import TransportNetwork
from hybridmpm.training.control.transport.trainer import TransportTrainer
from hybridmpm.training.onnx_program import exported
from hybridmpm.training.publish import Exported, parameters_of, training_record


def export_transport(path: Path) -> Exported:
    """Return the network of a checkpoint with its averaged weights as an ONNX model, and its training.

    Raises
    ------
    DataError
        `checkpoint.read` refuses the file, or it is the checkpoint of another network.
    ConfigError
        The network has other features than those of this library; the message names both versions.
    """
    trainer = TransportTrainer.load(path, torch.device("cpu"))
    training, count = training_record(path), parameters_of(trainer.average)
    properties = to_properties(
        FORMAT, spec=trainer.spec.to_dict(), training=training | {"parameters": str(count)}
    )
    return Exported(
        data=to_onnx(trainer.average, trainer.spec, properties),
        training=training,
        parameters=count,
        folder=ServedNetwork.FOLDER,
        rows={
            "answers": "where each particle of a fluid may have come from, given an oval or an arrow",
            "parameters": str(count),
        },
        entry={"dim": trainer.spec.dim},
        errors="See `docs/results/control.md`, method `learned`.",
    )


def to_onnx(network: TransportNetwork, spec: TransportSpec, properties: dict[str, str]) -> bytes:
    """Return a transport network as an ONNX model; the number of particles is free."""
    batch, count, dim = 1, 3, spec.dim
    example = (
        torch.zeros(batch, len(PLANES[dim]) * channels(dim, obstacles=spec.obstacles), CELLS, CELLS),
        torch.zeros(batch, numbers(dim)),
        torch.zeros(batch, count, of_particle(dim)),
        torch.zeros(batch, count, dim),
        torch.zeros(batch, count, dim),
        torch.zeros(batch),
    )
    free = torch.export.Dim.DYNAMIC
    sizes = {name: {1: free} if name in {"particles", "places", "noisy"} else {} for name in INPUTS}
    return exported(
        network.eval(),
        example,
        inputs=INPUTS,
        outputs=[OUTPUT],
        dynamic_shapes=sizes,
        properties=properties,
    )

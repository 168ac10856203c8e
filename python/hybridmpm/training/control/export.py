"""Exporting the transport network of a checkpoint as one ONNX file; serving it needs no torch."""

import datetime as dt
import hashlib
from collections.abc import Mapping
from pathlib import Path

import torch

from hybridmpm._support.files import replacing
from hybridmpm.control.methods.learned.features import CHANNELS, NUMBERS, OF_PARTICLE
from hybridmpm.control.methods.learned.manifest import WEIGHTS, write_digest
from hybridmpm.control.methods.learned.network import INPUTS, OUTPUT, properties_of
from hybridmpm.control.methods.learned.spec import CELLS
from hybridmpm.training import checkpoint
from hybridmpm.training.control.transport_network import TransportNetwork
from hybridmpm.training.control.transport_trainer import TransportTrainer
from hybridmpm.training.onnx_program import exported
from hybridmpm.training.publish import checked_name, checked_size


def export_transport(path: Path) -> tuple[bytes, dict[str, str]]:
    """Return the network of a checkpoint with its averaged weights as an ONNX model, and its training.

    Raises
    ------
    DataError
        `checkpoint.read` refuses the file, or it is the checkpoint of another network.
    ConfigError
        The network has other features than those of this library; the message names both versions.
    """
    trainer = TransportTrainer.load(path, torch.device("cpu"))
    state = checkpoint.read(path)
    steps, seconds = checkpoint.spent(state)
    training = {
        **{key: state["about"].get(key, "") for key in ("command", "data", "solver_versions", "machine")},
        "seconds": f"{seconds:.0f}",
        "steps": str(steps),
        "parameters": str(sum(weight.numel() for weight in trainer.average.parameters())),
        "exported": dt.datetime.now(dt.UTC).date().isoformat(),
    }
    return to_onnx(trainer.average, properties_of(trainer.spec, training)), training


def to_onnx(network: TransportNetwork, properties: dict[str, str]) -> bytes:
    """Return a transport network as an ONNX model; the number of particles is free."""
    batch, count = 1, 3
    example = (
        torch.zeros(batch, CHANNELS, CELLS, CELLS),
        torch.zeros(batch, NUMBERS),
        torch.zeros(batch, count, OF_PARTICLE),
        torch.zeros(batch, count, 2),
        torch.zeros(batch, count, 2),
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


def publish_transport(
    name: str, data: bytes, training: Mapping[str, str], folder: Path = WEIGHTS
) -> list[Path]:
    """Write a network, its card and its digest, and return the paths of these files.

    Raises
    ------
    ConfigError
        The name or the size is not one that a model of the library may have.
    ExportError
        A file cannot be written.
    """
    checked_name(name)
    checked_size(data)
    model, card = folder / f"{name}.onnx", folder / f"{name}.md"
    with replacing(model) as part:
        part.write_bytes(data)
    with replacing(card) as part:
        part.write_text(transport_card(name, training), encoding="utf-8")
    return [model, card, write_digest(name, hashlib.sha256(data).hexdigest(), folder)]


def transport_card(name: str, training: Mapping[str, str]) -> str:
    """Return the card of a transport network in Markdown."""
    rows = {
        "answers": "where each particle of a fluid may have come from, given an oval or an arrow",
        "parameters": training["parameters"],
        "data": training["data"],
        "solver": f"version {training['solver_versions']}",
        "command": f"`{training['command']}`",
        "time": f"{training['steps']} steps in {float(training['seconds']) / 60:.1f} minutes",
        "machine": training["machine"],
        "exported": training["exported"],
        "errors": "`docs/control-bench.md`, method `learned`",
        "licence": "Apache-2.0",
    }
    lines = [f"# {name}", "", "| | |", "|---|---|", *(f"| {key} | {text} |" for key, text in rows.items())]
    return "\n".join(lines) + "\n"

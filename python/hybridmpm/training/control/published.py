"""Networks of control as files: what is told of their training, and how they join those of the library."""

import datetime as dt
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from torch import nn

from hybridmpm._support.files import replacing
from hybridmpm.control.manifest import write_digest
from hybridmpm.training import checkpoint
from hybridmpm.training.publish import checked_name, checked_size


@dataclass(frozen=True, kw_only=True)
class Exported:
    """A network as an ONNX model."""

    data: bytes
    """The file."""
    training: Mapping[str, str]
    """Command, data, machine, steps and seconds of the training, and the number of parameters."""
    folder: Path
    """Where those are that come with the library."""
    answers: str
    """What the network answers, in a few words."""
    method: str
    """Name of the control method that uses it."""

    @property
    def parameters(self) -> int:
        """Number of weights."""
        return int(self.training["parameters"])

    def publish(self, name: str, folder: Path | None = None) -> list[Path]:
        """Write the network, its card and its digest, and return the paths of these files.

        Parameters
        ----------
        name : str
            Name of the network.
        folder : Path, optional
            Another folder than that of the library.

        Raises
        ------
        ConfigError
            The name or the size is not one that a model of the library may have.
        ExportError
            A file cannot be written.
        """
        checked_name(name)
        checked_size(self.data)
        folder = folder or self.folder
        folder.mkdir(exist_ok=True)
        model, card = folder / f"{name}.onnx", folder / f"{name}.md"
        with replacing(model) as part:
            part.write_bytes(self.data)
        with replacing(card) as part:
            part.write_text(self.card(name), encoding="utf-8")
        return [model, card, write_digest(name, hashlib.sha256(self.data).hexdigest(), folder)]

    def card(self, name: str) -> str:
        """Return the card of the network in Markdown."""
        training = self.training
        rows = {
            "answers": self.answers,
            "parameters": training["parameters"],
            "data": training["data"],
            "solver": f"version {training['solver_versions']}",
            "command": f"`{training['command']}`",
            "time": f"{training['steps']} steps in {float(training['seconds']) / 60:.1f} minutes",
            "machine": training["machine"],
            "exported": training["exported"],
            "errors": f"`docs/results/control.md`, method `{self.method}`",
            "licence": "Apache-2.0",
        }
        lines = [
            f"# {name}",
            "",
            "| | |",
            "|---|---|",
            *(f"| {key} | {text} |" for key, text in rows.items()),
        ]
        return "\n".join(lines) + "\n"


def told(path: Path, network: nn.Module) -> dict[str, str]:
    """Return what is to be told of the training of a checkpoint's network."""
    state = checkpoint.read(path)
    steps, seconds = checkpoint.spent(state)
    return {
        **{key: state["about"].get(key, "") for key in ("command", "data", "solver_versions", "machine")},
        "seconds": f"{seconds:.0f}",
        "steps": str(steps),
        "parameters": str(sum(weight.numel() for weight in network.parameters())),
        "exported": dt.datetime.now(dt.UTC).date().isoformat(),
    }

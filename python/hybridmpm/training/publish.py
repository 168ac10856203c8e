"""Exported networks: their files, cards and manifest entries among those of the library."""

import datetime as dt
import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from torch import nn

from hybridmpm._support.files import replacing
from hybridmpm._support.networks import NetworkFolder
from hybridmpm.errors import ConfigError
from hybridmpm.training import checkpoint

MAX_BYTES = 8_000_000
"""Largest size of a model that comes with the library [bytes]."""
RECORDED = ("command", "data", "solver_versions", "machine", "seconds", "steps", "exported")
"""Texts about a training that a network's file and card keep; `exported` is a date."""
_NAME = re.compile(r"[a-z][a-z0-9_-]{0,62}")


@dataclass(frozen=True, kw_only=True)
class Exported:
    """A network as an ONNX file, with what its card and its manifest entry say."""

    data: bytes
    """The file."""
    training: Mapping[str, str]
    """From `training_record`."""
    parameters: int
    """Number of weights."""
    folder: NetworkFolder
    """Networks of the library of the same kind."""
    rows: Mapping[str, str]
    """First rows of the card."""
    errors: str
    """Last lines of the card, about measured errors."""
    entry: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the manifest entry besides the digest."""

    def publish(self, name: str, folder: Path | None = None) -> list[Path]:
        """Write the network, its card and its entry in the manifest, and return the paths of these files.

        A network of the same name is replaced. A new one comes last in the manifest.

        Parameters
        ----------
        name : str
            Name of the network.
        folder : Path, optional
            Another folder than that of the library.

        Raises
        ------
        ConfigError
            The name has other characters than lower-case letters, digits, "-" and "_", or the network is
            larger than `MAX_BYTES`.
        ExportError
            A file cannot be written.
        """
        if not _NAME.fullmatch(name):
            raise ConfigError(
                'a model must be named by up to 63 lower-case letters, digits, "-" and "_", a letter first; '
                f"got {name!r}"
            )
        if len(self.data) > MAX_BYTES:
            raise ConfigError(
                f"a model of the library must have at most {MAX_BYTES} bytes, got {len(self.data)}; lower "
                "latent or layers"
            )
        there = self.folder if folder is None else NetworkFolder(folder)
        there.path.mkdir(exist_ok=True)
        model, card = there.path / f"{name}.onnx", there.path / f"{name}.md"
        with replacing(model) as part:
            part.write_bytes(self.data)
        with replacing(card) as part:
            part.write_text(self.card(name), encoding="utf-8")
        own = {"file": model.name} if self.entry else {}
        entry = own | {"sha256": hashlib.sha256(self.data).hexdigest()} | dict(self.entry)
        return [model, card, there.write_entry(name, entry)]

    def card(self, name: str) -> str:
        """Return the card of the network in Markdown."""
        recorded = {key: self.training.get(key) or "not recorded" for key in RECORDED}
        seconds = self.training.get("seconds")
        time = f"{float(seconds) / 60:.1f} minutes" if seconds else "an unrecorded time"
        rows = {
            **self.rows,
            "data": recorded["data"],
            "solver": f"version {recorded['solver_versions']}",
            "command": f"`{recorded['command']}`",
            "time": f"{recorded['steps']} steps in {time}",
            "machine": recorded["machine"],
            "exported": recorded["exported"],
            "licence": "Apache-2.0",
        }
        table = [f"| {key} | {text} |" for key, text in rows.items()]
        return "\n".join(
            [f"# {name}", "", "| | |", "|---|---|", *table, "", "## Errors", "", self.errors, ""]
        )


def training_record(path: Path) -> dict[str, str]:
    """Return the record of the training of a checkpoint: `RECORDED`, "" where a text is not known."""
    state = checkpoint.read(path)
    steps, seconds = checkpoint.spent(state)
    about = {
        "solver_versions": "1",
        **state["about"],
        "seconds": f"{seconds:.0f}",
        "steps": str(steps),
        "exported": dt.datetime.now(dt.UTC).date().isoformat(),
    }
    return {key: about.get(key, "") for key in RECORDED}


def parameters_of(network: nn.Module) -> int:
    """Return the number of weights."""
    return sum(weight.numel() for weight in network.parameters())

"""Adding a model to those that come with the library: its file, its manifest entry and its card."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import WEIGHTS, Entry, write_entry
from hybridmpm.physics.model_info import ModelInfo

MAX_BYTES = 8_000_000
"""Largest size of a model that comes with the library [bytes]."""
_NAME = re.compile(r"[a-z][a-z0-9_-]{0,62}")


def checked_name(name: str) -> None:
    """Refuse a name that a model of the library may not have.

    Raises
    ------
    ConfigError
        It has other characters than lower-case letters, digits, "-" and "_".
    """
    if not _NAME.fullmatch(name):
        raise ConfigError(
            'a model must be named by up to 63 lower-case letters, digits, "-" and "_", a letter first; got '
            f"{name!r}"
        )


def checked_size(data: bytes) -> None:
    """Refuse a model that is too large to come with the library.

    Raises
    ------
    ConfigError
        It is larger than `MAX_BYTES`.
    """
    if len(data) > MAX_BYTES:
        raise ConfigError(
            f"a model of the library must have at most {MAX_BYTES} bytes, got {len(data)}; lower latent or "
            "layers"
        )


def publish(name: str, data: bytes, info: ModelInfo, folder: Path = WEIGHTS) -> list[Path]:
    """Write a model, its card and its entry in the manifest, and return the paths of these files.

    A model of the same name is replaced. A new model comes last in the manifest, which lists models in order
    of preference.

    Raises
    ------
    ConfigError
        The name has other characters than lower-case letters, digits, "-" and "_", or the model is larger
        than `MAX_BYTES`.
    ExportError
        A file cannot be written.
    """
    checked_name(name)
    checked_size(data)
    model, card = folder / f"{name}.onnx", folder / f"{name}.md"
    with replacing(model) as part:
        part.write_bytes(data)
    with replacing(card) as part:
        part.write_text(model_card(name, info), encoding="utf-8")
    spec = info.spec
    entry = Entry(
        file=model.name,
        sha256=hashlib.sha256(data).hexdigest(),
        scenarios=spec.scenarios,
        r_p=spec.r_p,
        r_t=spec.r_t,
        latent=spec.latent,
        layers=spec.layers,
        radius=spec.radius,
        parameters=info.parameters,
        solver_versions=info.solver_versions,
    )
    write_entry(name, entry, folder)
    return [model, card, folder / "manifest.json"]


def model_card(name: str, info: ModelInfo) -> str:
    """Return the card of a model in Markdown, from the description in its file."""
    spec, training = info.spec, info.training
    rows = {
        "serves": ", ".join(spec.scenarios),
        "network": f"latent {spec.latent}, {spec.layers} layers, {spec.hidden_layers} hidden ReLU layers, "
        f"{spec.relaxations} relaxations of density; {info.parameters} parameters",
        "radius": f"{spec.radius:.4g} m, {spec.radius / spec.spacing:.2f} spacings",
        "particles": f"r_p = {spec.r_p:.4g}",
        "step": f"r_t = {spec.r_t} frames of {spec.frame_dt * 1e3:g} ms",
        "data": _recorded(training, "data"),
        "solver": "version " + ", ".join(map(str, info.solver_versions)),
        "command": f"`{_recorded(training, 'command')}`",
        "time": f"{training.get('steps', '?')} steps in {_minutes(training)}",
        "machine": _recorded(training, "machine"),
        "exported": _recorded(training, "exported"),
        "licence": "Apache-2.0",
    }
    lines = [f"# {name}", "", "| | |", "|---|---|", *(f"| {key} | {text} |" for key, text in rows.items())]
    return "\n".join([*lines, "", "## Errors", "", *_error_table(info.errors)]) + "\n"


def _recorded(training: Mapping[str, str], key: str) -> str:
    return training.get(key) or "not recorded"


def _minutes(training: Mapping[str, str]) -> str:
    seconds = training.get("seconds")
    return f"{float(seconds) / 60:.1f} minutes" if seconds else "an unrecorded time"


def _error_table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    if not rows:
        return ["Not measured."]
    columns = list(dict.fromkeys(key for row in rows for key in row))
    return [
        f"| {' | '.join(columns)} |",
        "|" + "---|" * len(columns),
        *(f"| {' | '.join(_cell(row.get(column, '')) for column in columns)} |" for row in rows),
    ]


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)

"""Checkpoints: a trainer's state in one file, written whole or not at all."""

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, DataError
from hybridmpm.training.physics.trainer import Trainer

_FORMAT = 1


def save(path: Path, trainer: Trainer, about: dict[str, str]) -> None:
    """Write a trainer's state, and texts about its origin; raises `ExportError`."""
    with replacing(path) as part:
        torch.save({"format": _FORMAT, "about": about, **trainer.state()}, part)


def read(path: Path) -> dict[str, Any]:
    """Read a file that `save` wrote, as tensors and plain data; nothing in it is run.

    Raises
    ------
    DataError
        The file is missing, damaged or no checkpoint of this version; the message names it.
    """
    if not path.is_file():
        raise DataError(f"{path} does not exist")
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (RuntimeError, pickle.UnpicklingError, EOFError, OSError, ValueError) as error:
        raise DataError(f"{path} is no checkpoint, or damaged or cut off: {error}") from None
    found = state.get("format") if isinstance(state, dict) else None
    if found != _FORMAT:
        raise DataError(f"{path} is a checkpoint of format {found}; this library reads {_FORMAT}")
    return dict(state)


def spent(state: Mapping[str, Any]) -> tuple[int, float]:
    """Return steps and seconds of training, those of the weights that it began with among them."""
    about = state["about"]
    return (
        int(about.get("steps_before", 0)) + state["step"],
        float(about.get("seconds_before", 0)) + state["seconds"],
    )


def load(path: Path, device: torch.device) -> Trainer:
    """Take up training from a file.

    Raises
    ------
    DataError
        As `read`, or its contents do not fit together.
    ConfigError
        It is of other features; the message names both versions.
    """
    state = read(path)
    try:
        return Trainer.restore(state, device, where=str(path))
    except (KeyError, RuntimeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise DataError(f"{path} does not fit this library: {error}") from None

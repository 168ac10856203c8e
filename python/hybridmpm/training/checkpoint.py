"""Checkpoints: a trainer's state in one file, written whole or not at all."""

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import torch

from hybridmpm._core import SOLVER_VERSION
from hybridmpm._support.files import replacing
from hybridmpm.errors import DataError
from hybridmpm.physics.model_info import solver_versions

_FORMAT = 1


class Kept(Protocol):
    """An object whose state a checkpoint stores."""

    def state(self) -> dict[str, Any]:
        """Return the state from which training continues, as tensors and plain data."""


def save(path: Path, trainer: Kept, about: Mapping[str, str]) -> None:
    """Write a trainer's state and texts about its origin.

    Raises
    ------
    ExportError
        The file cannot be written.
    """
    with replacing(path) as part:
        torch.save({"format": _FORMAT, "about": dict(about), **trainer.state()}, part)


def read(path: Path) -> dict[str, Any]:
    """Read a checkpoint as tensors and plain data; no code in the file is run.

    Raises
    ------
    DataError
        The file is missing, damaged or no checkpoint of this format; the message names the file.
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
    """Return steps and seconds of a checkpoint's training, including those of the weights it began with."""
    about = state["about"]
    return (
        int(about.get("steps_before", 0)) + state["step"],
        float(about.get("seconds_before", 0)) + state["seconds"],
    )


def with_this_solver(about: Mapping[str, str]) -> str:
    """Return the versions of the solvers of a checkpoint's data and of this one, as a text for `about`."""
    return ", ".join(map(str, sorted({*solver_versions(about), SOLVER_VERSION})))


def origin_of(state: Mapping[str, Any]) -> dict[str, str]:
    """Return the origin of a checkpoint's weights, for a training that begins with them.

    Returns
    -------
    dict
        `command`, which makes them; `solver_versions` of their data and of this solver; `steps_before` and
        `seconds_before`, which they took.
    """
    steps, seconds = spent(state)
    return {
        "command": f"{state['about']['command']} --until {state['step']}",
        "solver_versions": with_this_solver(state["about"]),
        "steps_before": str(steps),
        "seconds_before": f"{seconds:.1f}",
    }

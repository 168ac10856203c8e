"""Torch and its device, for commands that train."""

import importlib
from typing import TYPE_CHECKING, Any, cast

import click

from hybridmpm.errors import ConfigError

if TYPE_CHECKING:
    import torch


device_option = click.option(
    "--device",
    default="auto",
    show_default=True,
    help="Device of torch: cpu, cuda, or auto, which is cuda where there is one.",
)
"""Device of a training."""


def require_torch() -> Any:
    """Return the module torch, or raise `ConfigError`, whose message says what to install."""
    try:
        return importlib.import_module("torch")
    except ImportError:
        raise ConfigError("training needs torch; install it with: pip install 'hybridmpm[train]'") from None


def torch_device(library: Any, name: str) -> "torch.device":
    """Return the device of a name; "auto" is cuda where there is one, else cpu.

    Raises
    ------
    ConfigError
        The device cannot be used.
    """
    best = "cuda" if library.cuda.is_available() else "cpu"
    try:
        device = library.device(best if name == "auto" else name)
        library.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"--device {name} cannot be used: {reason}; choose cpu, cuda or auto") from None
    return cast("torch.device", device)

"""What commands that train need: torch, and the device that was asked for."""

import importlib
from typing import TYPE_CHECKING, Any, cast

from hybridmpm.errors import ConfigError

if TYPE_CHECKING:
    import torch


def require_torch() -> Any:
    """Return the module, or raise `ConfigError` saying what to install."""
    try:
        return importlib.import_module("torch")
    except ImportError:
        raise ConfigError("training needs torch; install it with: pip install 'hybridmpm[train]'") from None


def torch_device(library: Any, name: str) -> "torch.device":
    """Return the device of a name, "auto" among them; raises `ConfigError` where it cannot be used."""
    best = "cuda" if library.cuda.is_available() else "cpu"
    try:
        device = library.device(best if name == "auto" else name)
        library.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"--device {name} cannot be used: {reason}; choose cpu, cuda or auto") from None
    return cast("torch.device", device)

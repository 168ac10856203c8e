"""Torch's device and threads for a training."""

import torch

from hybridmpm.errors import ConfigError

Device = torch.device


def usable(name: str, threads: int | None = None) -> Device:
    """Return the device of a name, and set the number of torch's threads if it is given.

    Parameters
    ----------
    name : str
        "auto" is cuda where there is one, else cpu.
    threads : int, optional

    Raises
    ------
    ConfigError
        The device cannot be used.
    """
    if threads is not None:
        torch.set_num_threads(threads)
    best = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        device = torch.device(best if name == "auto" else name)
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"--device {name} cannot be used: {reason}; choose cpu, cuda or auto") from None
    return device

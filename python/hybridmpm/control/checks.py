"""Checks of arguments."""

import math

import numpy as np
import numpy.typing as npt

from hybridmpm._support.arguments import float64
from hybridmpm.control.goal.cloud import Floats
from hybridmpm.errors import ConfigError


def positive(name: str, value: object, most: float = math.inf) -> float:
    """Return `value` as a finite float in (0, most], or raise `ConfigError`."""
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        number = float(value)
        if math.isfinite(number) and 0 < number <= most:
            return number
    allowed = f"in (0, {most:g}]" if math.isfinite(most) else "above 0 and finite"
    raise ConfigError(f"{name} must be a number {allowed}, got {value!r}")


def vector(name: str, value: npt.ArrayLike, dim: int | None = None) -> Floats:
    """Return `value` as D finite numbers, or raise `ConfigError`; D is `dim`, or 2 or 3 without it."""
    allowed = "2 or 3" if dim is None else str(dim)
    array = float64(name, value).copy()
    sizes = (2, 3) if dim is None else (dim,)
    if array.ndim != 1 or len(array) not in sizes or not np.isfinite(array).all():
        raise ConfigError(f"{name} must be {allowed} finite numbers, got {array.tolist()}")
    return array

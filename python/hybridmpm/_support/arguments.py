"""Checks of arguments before the compiled core gets them, whose integers have fixed sizes."""

import operator
from typing import Any

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import ConfigError


def whole(name: str, value: object, low: int, high: int) -> int:
    """Return `value` as an int in [low, high], or raise `ConfigError`, whose message has `name` and range."""
    refusal = f"{name} must be a whole number in [{low}, {high}], got {value!r}"
    if isinstance(value, bool):  # Python counts it as an int, but the caller made a slip
        raise ConfigError(refusal)
    try:
        number = operator.index(value)  # type: ignore[arg-type]  # what is no integer raises
    except TypeError:
        raise ConfigError(refusal) from None
    if not low <= number <= high:
        raise ConfigError(f"{name} must be in [{low}, {high}], got {number}")
    return number


def real(name: str, value: object, low: float, high: float) -> float:
    """Return `value` as a float in [low, high], or raise `ConfigError`; its message has `name` and range."""
    try:
        # True is a slip, as the `yes` of a YAML file; what is no number raises.
        number = float("nan") if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = float("nan")
    if not low <= number <= high:
        raise ConfigError(f"{name} must be in [{low:g}, {high:g}], got {value!r}")
    return number


def flag(name: str, value: object) -> bool:
    """Return a value that must be True or False, or raise `ConfigError`."""
    if not isinstance(value, bool):
        raise ConfigError(f"{name} must be True or False, got {value!r}")
    return value


def unmasked(name: str, value: Any, error: type[Exception] = ConfigError) -> Any:
    """Return a value that is no masked array, or raise an error: its mask would be lost."""
    if isinstance(value, np.ma.MaskedArray):
        raise error(
            f"{name} must be an array without a mask, which would be lost, got a masked array: fill it by "
            ".filled(value), or leave masked rows out"
        )
    return value


def float32(name: str, value: npt.ArrayLike, *shapes: str) -> npt.NDArray[np.float32]:
    """Return `value` as a contiguous float32 array with as many axes as one of `shapes`, e.g. "(N, D)".

    Raises
    ------
    ConfigError
        `value` is no array of numbers, or its number of axes fits none of `shapes`. The lengths of axes are
        not checked here, but by the core.
    """
    expected = f"{name} must be numbers of shape {' or '.join(shapes)}"
    unmasked(name, value)
    try:
        # Numbers too large for float32 become infinite; the core then names the particle that has one.
        with np.errstate(over="ignore"):
            array = np.asarray(value, dtype=np.float32, order="C")
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{expected}: {error}") from None
    if array.ndim not in {len(shape.split()) for shape in shapes}:
        raise ConfigError(f"{expected}, got shape {array.shape}")
    return array


def float64(name: str, value: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return `value` as a float64 array of any shape, or raise `ConfigError`."""
    try:
        return np.asarray(unmasked(name, value), dtype=np.float64)
    except ConfigError:
        raise
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{name} must be numbers: {error}") from None


def no_truth_value(value: object) -> object:
    """Return `value`; raise ValueError where it is true or false, which pydantic takes for 1 or 0."""
    if isinstance(value, bool):
        raise ValueError(f"must be a number, got {str(value).lower()}")  # noqa: TRY004 - what pydantic expects
    return value

"""What all benchmarks have in common: rows of figures, and the progress of a measurement."""

from collections.abc import Callable
from typing import Any

Row = dict[str, Any]
"""One measurement, or all that was measured of one method: a flat object of JSON."""

Progress = Callable[[int], object]
"""Function that takes the number of steps done since its last call."""


def significant(value: float | None, digits: int = 4) -> float | None:
    """Round a figure to so many significant digits; None stays None."""
    return None if value is None else float(f"{value:.{digits}g}")

"""Rows of figures, the progress of a measurement, and the seeds and frames of all errors."""

from collections.abc import Callable
from typing import Any

Row = dict[str, Any]
"""One measurement, or all that was measured of one method: a flat object of JSON."""

Progress = Callable[[int], object]
"""Function that takes the number of steps done since its last call."""


def significant(value: float | None, digits: int = 4) -> float | None:
    """Round a figure to so many significant digits; None stays None."""
    return None if value is None else float(f"{value:.{digits}g}")


FIRST_SEED = 1_100_000
"""Seed of the first test scene of each scenario: no data set and no fit goes so far."""
AT = (40, 100, 200)
"""Frames, counted from the start of a measurement, whose errors are reported alone."""
EVERY = 10
"""Frames between two states that are compared."""

"""What every validation case consists of: a run, its judged figures, and a chart."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Check:
    """A measured figure with the values that are accepted."""

    quantity: str
    """Name of the figure, with its unit."""
    measured: float
    target: str
    """Value that the figure should have, for a reader."""
    tolerance: str
    """Values that are accepted, for a reader; "none" if the figure is only reported."""
    low: float = -math.inf
    """Lower end of the accepted range; infinite if the figure is only reported."""
    high: float = math.inf
    """Upper end of the accepted range; infinite if the figure is only reported."""
    outside: bool = False
    """Whether the figure is a negative control, which must lie outside the range."""

    @property
    def verdict(self) -> str:
        """Whether the figure is accepted: "pass" or "FAIL", or "reported" if every value is accepted."""
        if math.isinf(self.low) and math.isinf(self.high):
            return "reported"
        if math.isnan(self.measured):
            return "FAIL"
        return "pass" if (self.low <= self.measured <= self.high) != self.outside else "FAIL"

    @classmethod
    def at_most(cls, quantity: str, measured: float, limit: float) -> Self:
        """Return a check of an error, which must be at most `limit` in size."""
        text = f"<= {limit:g}"
        return cls(quantity=quantity, measured=measured, target="0", tolerance=text, low=-limit, high=limit)

    @classmethod
    def between(
        cls, quantity: str, measured: float, low: float, high: float, *, outside: bool = False
    ) -> Self:
        """Return a check of a figure, which must lie in a band, or outside it as a negative control."""
        return cls(
            quantity=quantity,
            measured=measured,
            target=f"{low:.3g} to {high:.3g}",
            tolerance="outside the band" if outside else "inside the band",
            low=low,
            high=high,
            outside=outside,
        )

    @classmethod
    def reported(cls, quantity: str, measured: float, target: str = "") -> Self:
        """Return a check that reports a figure and accepts every value."""
        return cls(quantity=quantity, measured=measured, target=target, tolerance="none")


class CaseResult(Protocol):
    """Curves and error figures of a run."""

    @property
    def checks(self) -> tuple[Check, ...]:
        """All figures that the page lists."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A validation case, as the command and the page need it."""

    name: str
    """Name of the case on the command line and in file names."""
    title: str
    """Title of the case on the page."""
    text: str
    """What is measured, how, and what it shows, as one paragraph of Markdown."""
    run: Callable[[], CaseResult]
    """Runs the case at full length."""
    draw: "Callable[[Any], Figure]"
    """Draws the result of `run`."""

"""What every validation case is made of: a run, its judged figures, and a chart."""

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
    """A measured figure beside what it is held against."""

    quantity: str
    measured: float
    target: str
    """What it should be, for a reader."""
    tolerance: str
    """What is still accepted, for a reader; "none" where the figure is only reported."""
    low: float = -math.inf
    high: float = math.inf
    """The accepted range, ends included; both infinite where the figure is only reported."""
    outside: bool = False
    """Of a negative control, which has to lie outside the range."""

    @property
    def verdict(self) -> str:
        """Whether it is accepted: "pass", "FAIL", or "reported" where nothing is demanded."""
        if math.isinf(self.low) and math.isinf(self.high):
            return "reported"
        if math.isnan(self.measured):
            return "FAIL"
        return "pass" if (self.low <= self.measured <= self.high) != self.outside else "FAIL"

    @classmethod
    def at_most(cls, quantity: str, measured: float, limit: float) -> Self:
        """Demand of an error that its size is at most `limit`."""
        text = f"<= {limit:g}"
        return cls(quantity=quantity, measured=measured, target="0", tolerance=text, low=-limit, high=limit)

    @classmethod
    def between(
        cls, quantity: str, measured: float, low: float, high: float, *, outside: bool = False
    ) -> Self:
        """Demand of a figure that it lies in a band, or outside it for a negative control."""
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
        """Tell a figure without judging it."""
        return cls(quantity=quantity, measured=measured, target=target, tolerance="none")


class Result(Protocol):
    """Curves of a run with their error figures."""

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every figure that the page lists."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A validation case as the command and the page see it."""

    name: str
    title: str
    text: str
    """How it is measured and what it shows, as one paragraph of Markdown."""
    run: Callable[[], Result]
    """Runs it in full."""
    draw: "Callable[[Any], Figure]"
    """Draws the result of `run`."""

"""Reversed control data: a fluid led back to where it came from, with the sketch that asks for it.

Paper, section 3.2.2. A forward run gives a past, `reversed_case` turns it into an example of control: the
state at its start, a sketch of the state at its end, and forces that lead from one to the other. The method
`Oracle` follows such a sketch by these forces; no controller that sees the sketch alone can know them.
"""

from hybridmpm.control.reversal.case import (
    DEFAULT_FRAMES,
    KINDS,
    STARTS,
    Kind,
    ReversedCase,
    Start,
    reversed_case,
)
from hybridmpm.control.reversal.draw import MAX_DRAWN_FRAMES, reversed_from_seed
from hybridmpm.control.reversal.smoothing import smoothed, step_cosines

__all__ = [
    "DEFAULT_FRAMES",
    "KINDS",
    "MAX_DRAWN_FRAMES",
    "STARTS",
    "Kind",
    "ReversedCase",
    "Start",
    "reversed_case",
    "reversed_from_seed",
    "smoothed",
    "step_cosines",
]

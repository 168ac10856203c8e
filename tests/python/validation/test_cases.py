"""The solver against experiments and closed forms, as `hybridmpm validate` runs them, with its tolerances."""

from collections.abc import Callable
from functools import cache

import pytest

from hybridmpm.validation import (
    CASES,
    colliding_discs,
    column_collapse,
    dam_break,
    rotation,
    sliding_block,
)
from hybridmpm.validation.case import CaseResult, Check

SHORTER: dict[str, Callable[[], CaseResult]] = {
    "dam_break": lambda: dam_break.run((64, 128)),
    "column_collapse": lambda: column_collapse.run((0.5, 2.0)),
    "sliding_block": lambda: sliding_block.run((32,)),
    "rotation": lambda: rotation.run(disc_seconds=1.0, ball_seconds=1.0),
    "colliding_discs": lambda: colliding_discs.run((32, 64)),
}
"""Cases without their finest grids or longest runs, to save time; the command runs them in full."""

LONGER: dict[str, Callable[[], CaseResult]] = {
    "column_collapse": column_collapse.run,
    "rotation": rotation.run,
}
"""More of those of `SHORTER` that leave much out."""

KNOWN = {
    "dam_break": ("front", "water without friction, released at once, sends a thin tongue ahead"),
}
"""Checks that fail today, by the beginning of their names, and why."""


@cache
def checks(name: str) -> tuple[Check, ...]:
    return SHORTER.get(name, CASES[name].run)().checks


def failures(name: str, *, known: bool) -> list[Check]:
    """Failed checks of a case, either the known ones or all others."""
    beginning = KNOWN[name][0] if name in KNOWN else None
    return [
        check
        for check in checks(name)
        if check.verdict == "FAIL"
        and (beginning is not None and check.quantity.startswith(beginning)) == known
    ]


@pytest.mark.parametrize("name", CASES)
def test_case(name: str) -> None:
    assert any(check.verdict == "pass" for check in checks(name))
    assert failures(name, known=False) == []


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.xfail(strict=True, reason=reason))
        for name, (_, reason) in KNOWN.items()
    ],
)
def test_known_failures(name: str) -> None:
    assert failures(name, known=True) == []


@pytest.mark.long
@pytest.mark.parametrize("name", LONGER)
def test_longer_case(name: str) -> None:
    assert [check for check in LONGER[name]().checks if check.verdict == "FAIL"] == []

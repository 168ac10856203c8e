"""The coarse modes of MPM: fewer particles alone, showing all, and at fitted constants."""

import dataclasses
from dataclasses import dataclass

from hybridmpm_lab.compare import tradeoff
from hybridmpm_lab.compare.comparison import RIVALS, Case, ComparisonSettings
from hybridmpm_lab.harness.settings import scenarios_setting

SCENARIOS = ("water_2d", "sand_2d", "water_3d", "sand_3d")
"""Scenarios of one material without obstacles."""


@dataclass(frozen=True, kw_only=True)
class CoarseSettings(ComparisonSettings):
    """Settings of the comparison of coarse modes."""

    scenario: tuple[str, ...] = scenarios_setting(SCENARIOS)


def cases(settings: CoarseSettings) -> list[Case]:
    """Return a case for each scenario: the solvers of the trade-off, from the first impact on."""
    given = {name: getattr(settings, name) for name in ("scenario", "scenes", "span", "threads", "method")}
    return [
        dataclasses.replace(
            case,
            methods={name: one for name, one in case.methods.items() if one.method in RIVALS},
            warm_up=0,
        )
        for case in tradeoff.cases(tradeoff.TradeoffSettings(**given))
    ]

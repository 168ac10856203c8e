"""The seven seeded scenarios: `water_2d(seed)` and its siblings return a `Scene`.

`samplers.py` and docs/reference/scenarios.md list the ranges from which the scenes are drawn.
"""

from hybridmpm.scenarios.scenarios import (
    MAX_SEED,
    NAMES,
    ScenarioInfo,
    describe,
    get,
    sand_2d,
    sand_3d,
    sand_ramps_2d,
    water_2d,
    water_3d,
    water_ramps_2d,
    water_sand_2d,
)

__all__ = [
    "MAX_SEED",
    "NAMES",
    "ScenarioInfo",
    "describe",
    "get",
    "sand_2d",
    "sand_3d",
    "sand_ramps_2d",
    "water_2d",
    "water_3d",
    "water_ramps_2d",
    "water_sand_2d",
]


def __dir__() -> list[str]:
    return sorted(__all__)

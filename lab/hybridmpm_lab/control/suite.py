"""The cases of the suite: families, scenarios and seeds, and a digest of all of them."""

import functools
import hashlib
import json
from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from hybridmpm import scenarios
from hybridmpm.control import Ellipse
from hybridmpm_lab.control.starts import Start, drawn_start

VERSION = 2
"""Version of the suite; raised whenever a case changes."""

Family = Literal["reversed", "free", "bent", "obstacles", "gather", "hand"]
Kind = Literal["oval", "arrow"]

FAMILIES: tuple[Family, ...] = get_args(Family)
SETTINGS = ("water_2d", "sand_2d", "water_3d", "sand_3d")
"""Scenarios of the reversed family, the paper's four settings."""
_OPEN = tuple(name for name in scenarios.NAMES if "ramps" not in name)
_BOTH: tuple[Kind, ...] = get_args(Kind)
_SUITE: dict[Family, tuple[tuple[str, ...], tuple[Kind, ...], range]] = {
    "reversed": (SETTINGS, _BOTH, range(1_200_000, 1_200_060)),
    "free": (scenarios.NAMES, ("oval",), range(1_210_000, 1_210_010)),
    "bent": (_OPEN, ("arrow",), range(1_220_000, 1_220_010)),
    "obstacles": (scenarios.NAMES, ("oval",), range(1_230_000, 1_230_010)),
    "gather": (_OPEN, ("oval",), range(1_240_000, 1_240_010)),
    "hand": (("water_2d", "sand_2d", "water_sand_2d"), _BOTH, range(1_245_000, 1_245_005)),
}
"""Scenarios, kinds of sketches and seeds of each family.

Ramps leave no room for a shape on a bent path, or for a letter."""
_MOST = 50  # Largest number of sketches of each kind in a family and scenario
_STILL: dict[str, tuple[int, ...]] = {
    "water_2d": (2, 11),
    "sand_2d": (3, 16, 40, 46),
    "water_3d": (0, 5, 14, 17, 25, 40),
    "sand_3d": (0, 3, 14, 19, 27, 33, 37, 41, 53),
}
"""Reversed seeds, counted from the first, that are left out: in the front view their centre of mass moves by
less than 5 cm in the 100 frames, and a sketch would describe no motion."""
REFERENCE_SEEDS = range(1_250_000, 1_250_100)
"""Seeds of the uncontrolled scenes that naturalness is measured against."""


@dataclass(frozen=True)
class Case:
    """One sketch on one state; everything else follows from these four."""

    family: Family
    scenario: str
    kind: Kind
    seed: int

    def start(self) -> Start:
        """Return scene, frame and sketch; not for `reversed`, whose sketch follows from a run."""
        return drawn_start(self.family, self.scenario, self.kind, self.seed)


def cases(
    families: Collection[str] = FAMILIES, names: Collection[str] = scenarios.NAMES, seeds: int | None = None
) -> list[Case]:
    """Return the cases of some families and scenarios, at most `seeds` of each kind of sketch."""
    return [
        Case(family, scenario, kind, seed)
        for family, (mine, kinds, _) in _SUITE.items()
        if family in families
        for scenario in mine
        if scenario in names
        for kind in kinds
        for seed in _seeds(family, scenario)[:seeds]
    ]


def _seeds(family: Family, scenario: str) -> list[int]:
    left_out = _STILL[scenario] if family == "reversed" else ()
    return [seed for index, seed in enumerate(_SUITE[family][2]) if index not in left_out][:_MOST]


@functools.cache
def digest(version: int = VERSION) -> str:
    """Return a hash of all scenes and sketches, and of the seeds of reversed cases.

    It changes with versions of numpy that draw other numbers from the same seed.
    """
    entries = [[version, REFERENCE_SEEDS.start, REFERENCE_SEEDS.stop], *map(_entry, cases())]
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()[:16]


def _entry(case: Case) -> list[object]:
    head: list[object] = [case.family, case.scenario, case.kind, case.seed]
    if case.family == "reversed":
        return [*head, scenarios.get(case.scenario, case.seed).model_dump(mode="json")]
    start = case.start()
    sketch = start.sketch
    numbers = (
        [*sketch.center, *sketch.axes, sketch.angle, sketch.width or 0.0]
        if isinstance(sketch, Ellipse)
        else sketch.points.ravel()
    )
    return [*head, start.scene.model_dump(mode="json"), start.frame, np.round(numbers, 9).tolist()]

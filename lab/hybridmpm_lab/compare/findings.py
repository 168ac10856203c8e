"""Findings about coarse levels, right and wrong, in random scenes.

What a level is said to choke or to tear is compared with what it does, beside the full solver.
"""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from hybridmpm import Box, BoxObstacle, BoxSink, MpmSolver, Scene, metrics
from hybridmpm.coarse import coarse_level, coarse_warnings
from hybridmpm_lab.harness.command import Measurement, measured, setting
from hybridmpm_lab.harness.rows import Progress, Row, significant

_FRAMES = 300
_LEVELS = ("1/64", "1/16", "1/4")
_LEAST = 0.02
"""Share of the full solver's matter that has to pass in a scene that counts [-]."""
_GRID = 32
"""Cells per metre of the grid on which states are compared."""


def _gap(rng: np.random.Generator, material: str) -> Scene:
    """Return matter above a slit in a floor, or behind a hole in a wall, at the floor or above it."""
    width, at = rng.uniform(0.015, 0.12), rng.uniform(0.3, 0.7)
    thick = rng.uniform(0.02, 0.08)
    if rng.random() < 0.5:
        solids = [((0.05, 0.4), (at - width / 2, 0.4 + thick)), ((at + width / 2, 0.4), (0.95, 0.4 + thick))]
        body = ((0.2, 0.41 + thick), (0.8, 0.6 + thick))
    else:
        foot = rng.choice([0.1, 0.15])
        solids = [((0.5, foot + width), (0.5 + thick, 0.9)), ((0.5, 0.05), (0.5 + thick, foot))]
        solids, body = solids[: 1 + (foot > 0.1)], ((0.1, 0.1), (0.49, 0.5))
    obstacles = [BoxObstacle(lower=lower, upper=upper) for lower, upper in solids]
    return Scene(dim=2, bodies=[Box(material=material, lower=body[0], upper=body[1])], obstacles=obstacles)


def _sink(rng: np.random.Generator, _: str) -> Scene:
    low, high = rng.uniform([0.1, 0.1], [0.7, 0.15]), rng.uniform([0.01, 0.01], [0.12, 0.06])
    sink = BoxSink(lower=tuple(low), upper=tuple(low + high))
    return Scene(dim=2, bodies=[Box(material="water", lower=(0.1, 0.1), upper=(0.9, 0.3))], sinks=[sink])


def _thin(rng: np.random.Generator, material: str) -> Scene:
    """Return a bar that falls onto the edge of an obstacle."""
    thick, left = rng.uniform(0.012, 0.12), rng.uniform(0.15, 0.35)
    bar = Box(material=material, lower=(left, 0.5), upper=(left + rng.uniform(0.2, 0.4), 0.5 + thick))
    edge = BoxObstacle(lower=(0.4, 0.1), upper=(0.5, rng.uniform(0.2, 0.4)))
    return Scene(dim=2, bodies=[bar], obstacles=[edge])


def _passed(scene: Scene, solver: MpmSolver) -> float:
    if scene.sinks:
        return 1 - float(solver.mass.sum()) / float(scene.sample().mass.sum())
    is_floor = scene.bodies[0].bounds[0][1] > 0.2
    x = solver.positions
    return float((x[:, 1] < 0.4 if is_floor else x[:, 0] > 0.5).mean())


KINDS: dict[str, tuple[Callable[[np.random.Generator, str], Scene], str, str, float]] = {
    "gap, sand": (_gap, "sand", "the gap", 0.8),
    "gap, water": (_gap, "water", "the gap", 0.8),
    "sink": (_sink, "water", "sinks[", 0.8),
    "elastic bar": (_thin, "elastic", "bodies[", 0.5),
    "bar of water": (_thin, "water", "bodies[", 0.5),
    "bar of sand": (_thin, "sand", "bodies[", 0.5),
}
"""Scenes, material, words of the finding, and the bound beyond which it is right.

The bound is a share of the full solver's matter that passes, or a mean grid RMSE.
"""


@dataclass(frozen=True)
class Settings:
    """Scenes of the comparison."""

    scenes: int = setting(40, "Number of scenes of each kind.", low=1)
    first: int = setting(7_000_000, "Seed of the first scene.", low=0)

    @property
    def steps(self) -> int:
        """Number of scenes."""
        return self.scenes * len(KINDS)


def _is_right(scene: Scene, level: str, bound: float, *, is_thin: bool) -> bool | None:
    """Return whether a level does much worse than the full solver; None where little passes in either."""
    full, coarse = MpmSolver(scene), MpmSolver(scene, coarse=level)
    if not is_thin:
        full.advance(_FRAMES)
        coarse.advance(_FRAMES)
        passed = _passed(scene, full)
        return None if passed < _LEAST else _passed(scene, coarse) < bound * passed
    errors = []
    for _ in range(_FRAMES // 20):
        full.advance(20)
        coarse.advance(20)
        states = [metrics.grid_mass(one.positions, one.mass, _GRID) for one in (coarse, full)]
        errors.append(float(metrics.grid_rmse(*states)))
    return float(np.mean(errors)) > bound


def measure(settings: Settings, advance: Progress) -> Iterator[Row]:
    """Yield a row for each kind of finding."""
    for kind, (make, material, words, bound) in KINDS.items():
        counts = dict.fromkeys(((a, b) for a in (True, False) for b in (True, False)), 0)
        for seed in range(settings.first, settings.first + settings.scenes):
            scene = make(np.random.default_rng(seed), material)
            level = _LEVELS[seed % len(_LEVELS)]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                said = any(words in text for text in coarse_warnings(scene, coarse_level(scene, level)))
                right = _is_right(scene, level, bound, is_thin=make is _thin)
            if right is not None:
                counts[said, right] += 1
            advance(1)
        yield {
            "finding": kind,
            "scenes": sum(counts.values()),
            "found": counts[True, True],
            "false": counts[True, False],
            "missed": counts[False, True],
            "silent": counts[False, False],
            "right": significant(
                (counts[True, True] + counts[False, False]) / max(sum(counts.values()), 1), 2
            ),
        }


findings = Measurement(
    name="findings",
    summary="Compare findings about coarse levels with what the levels do in random scenes.",
    settings=Settings,
    measure=measured(measure),
    columns=("finding", "scenes", "found", "false", "missed", "silent", "right"),
).command()

"""The family of networks of a sweep: r_t, r_p, sizes and radii, on two scenarios."""

import dataclasses
import fnmatch
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from hybridmpm.bench.accuracy.conventions import RATIOS
from hybridmpm.errors import ConfigError
from hybridmpm.physics.spec import NetworkSpec

SCENARIOS = ("water_2d", "sand_2d")
STRIDES = (1, 2, 4, 8, 16)
"""Frames that a network computes at once, r_t."""
SIZES = {"32x3": (32, 3, 1), "64x4": (64, 4, 1), "128x10": (128, 10, 2)}
"""Latent, layers and hidden layers by label; the last is the paper's network."""
RADII = (2.2, 2.9)
"""Connectivity radii in spacings of the particles; the larger is the paper's."""


@dataclass(frozen=True, kw_only=True)
class SweepSettings:
    """What all points of a sweep have in common; the points in one folder of results have the same."""

    scenes: int = 10
    """Number of test scenes of each scenario."""
    span: int = 200
    """Number of frames of each scene that errors count over."""
    threads: int = 1
    """Threads of every simulator."""
    relaxations: int = 3
    """Rounds of the relaxation of density after each step of each network."""
    trajectories: int = 40
    """Number of trajectories that each network is trained on."""
    frames: int = 320
    """Number of frames of a trajectory."""
    batch: int = 2
    """Number of windows of trajectories in a step of training."""
    unroll: int = 3
    """Largest number of network steps that training looks ahead."""
    seed: int = 0
    """Seed of initial weights and of all that training draws."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """A network of the family on one scenario."""

    scenario: str
    """Name in `SCENARIOS`."""
    r_t: int
    """Frames that the network computes at once."""
    ratio: str
    """Label of r_p in `RATIOS`."""
    size: str
    """Label in `SIZES`."""
    spacings: float
    """Connectivity radius in spacings of the particles."""

    @property
    def name(self) -> str:
        """Name of the network, the same in all scenarios."""
        return f"t{self.r_t}-p{self.ratio.replace('/', '_')}-{self.size}-R{self.spacings}"

    @property
    def key(self) -> str:
        """Name of the point: that of its files, and the one that patterns are matched with."""
        return f"{self.scenario}-{self.name}"

    def spec(self, relaxations: int) -> NetworkSpec:
        """Return the architecture of the network, with so many rounds of relaxation."""
        latent, layers, hidden_layers = SIZES[self.size]
        spec = NetworkSpec(
            scenarios=(self.scenario,),
            latent=latent,
            layers=layers,
            hidden_layers=hidden_layers,
            radius=1.0,
            r_p=RATIOS[self.ratio],
            r_t=self.r_t,
            relaxations=relaxations,
        )
        return dataclasses.replace(spec, radius=round(self.spacings * spec.spacing, 6))


POINTS = tuple(
    Point(scenario=scenario, r_t=r_t, ratio=ratio, size=size, spacings=spacings)
    for scenario, ratio, r_t, size, spacings in itertools.product(
        SCENARIOS, reversed(RATIOS), reversed(STRIDES), SIZES, RADII
    )
)
"""All points, the quick ones first; those that share training data are side by side."""


def matching(patterns: Sequence[str]) -> list[Point]:
    """Return the points whose key matches one of the shell patterns; without patterns all points.

    Raises
    ------
    ConfigError
        A pattern matches no point.
    """
    for pattern in patterns:
        if not any(fnmatch.fnmatchcase(point.key, pattern) for point in POINTS):
            raise ConfigError(
                f"no point matches {pattern!r}; their names are like {POINTS[0].key} and {POINTS[-1].key}, "
                "and * stands for anything"
            )
    return [
        point
        for point in POINTS
        if not patterns or any(fnmatch.fnmatchcase(point.key, pattern) for pattern in patterns)
    ]

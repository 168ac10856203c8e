"""`TransportSpec`: what a transport network is, besides its weights."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

from hybridmpm import scenarios
from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene

FEATURES_VERSION = 1
"""Raised when the same inputs give other features; checkpoints and models of another version are refused."""
CELLS = 32
"""Cells of the network's grid along each axis, between the walls."""
_NEAR = 1e-3
"""Relative difference of lengths and accelerations that count as the same."""


@dataclass(frozen=True, kw_only=True)
class TransportSpec:
    """A transport network: from a state and a sketch to the place of each particle at the end.

    Raises
    ------
    ConfigError
        A number is out of range, a scenario is unknown or no 2D scenario, or the scenarios differ in their
        box.
    """

    scenarios: tuple[str, ...]
    """Whose scenes it is trained on."""
    width: int = 24
    """Channels on the finest grid, in [4, 256]; a multiple of 4."""
    shortest: float = 0.1
    """Shortest time in which a goal is to be reached, of those that it is trained on [s]."""
    longest: float = 0.4
    """Longest such time [s]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "scenarios", tuple(self.scenarios))
        whole("width", self.width, 4, 256)
        if self.width % 4:
            raise ConfigError(f"width must be a multiple of 4, got {self.width}")
        if not (math.isfinite(self.longest) and 0 < self.shortest <= self.longest):
            raise ConfigError(
                f"shortest and longest must be 0 < shortest <= longest, got {self.shortest} and "
                f"{self.longest} s"
            )
        if not self.scenarios:
            raise ConfigError("a transport network needs at least one scenario")
        scenes = [scenarios.get(name, 0) for name in self.scenarios]
        if any(scene.dim != 2 or scene.obstacles for scene in scenes):
            raise ConfigError(
                "transport networks are for scenarios in 2D without obstacles, got "
                + ", ".join(self.scenarios)
            )
        if len({scene.walls for scene in scenes}) > 1:
            raise ConfigError("the scenarios of one network must share their walls")

    @property
    def example(self) -> Scene:
        """A scene that it is trained on, for walls and gravity."""
        return scenarios.get(self.scenarios[0], 0)

    def clipped(self, seconds: float) -> float:
        """Return the time nearest to `seconds` among those that the network is trained on [s]."""
        return min(max(seconds, self.shortest), self.longest)

    def foreign(self, scene: Scene) -> str | None:
        """Tell in which way a scene is of another kind than those of the training; None if it is not."""
        like = self.example
        if scene.dim != like.dim:
            return f"it is trained in {like.dim}D only"
        if scene.obstacles:
            return "it is trained without obstacles"
        if scene.is_open:
            return "it is trained without emitters and sinks"
        if not _alike(scene.walls.lower + scene.walls.upper, like.walls.lower + like.walls.upper):
            return "it is trained in another box"
        if not _alike(scene.gravity, like.gravity):
            return "it is trained under another gravity"
        known = {material.kind for name in self.scenarios for material in scenarios.get(name, 0).materials}
        foreign = sorted({material.kind for material in scene.materials} - known)
        return f"it is trained without {foreign[0]}" if foreign else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that `from_dict` reads."""
        return {**asdict(self), "features": FEATURES_VERSION}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], *, where: str) -> Self:
        """Read what `to_dict` gave.

        Raises
        ------
        ConfigError
            Of other features; the message begins with `where` and names both versions.
        """
        plain = dict(data)
        there = plain.pop("features", None)
        if there != FEATURES_VERSION:
            raise ConfigError(
                f"{where} has transport features of version {there}; this library has version "
                f"{FEATURES_VERSION}: train it anew"
            )
        return cls(**plain)


def _alike(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= _NEAR * max(1.0, abs(b)) for a, b in zip(one, other, strict=True))

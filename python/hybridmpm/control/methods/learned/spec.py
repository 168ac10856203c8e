"""`TransportSpec`: the settings of a transport network besides its weights."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

from hybridmpm._support.arguments import whole
from hybridmpm.errors import ConfigError
from hybridmpm.scenarios.trained_on import TrainedOn

FEATURES_VERSION = 1
"""Raised when the same inputs give other features; checkpoints and models of another version are refused."""
CELLS = 32
"""Cells of each plane of the network along both axes, between the walls."""


@dataclass(frozen=True, kw_only=True)
class TransportSpec:
    """A transport network: from a state and a sketch to the place of each particle at the end.

    Raises
    ------
    ConfigError
        A number is out of range, a scenario is unknown, or the scenarios differ in what one network must
        share.
    """

    scenarios: tuple[str, ...]
    """Scenarios in the training data, or names of other scenes."""
    scenes: TrainedOn | None = None
    """Properties of the scenes in the training data; if None, those of the scenarios."""
    width: int = 24
    """Channels on the finest cells, in [4, 256]; a multiple of 4."""
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
        _ = self.trained_on

    @property
    def trained_on(self) -> TrainedOn:
        """Properties of the scenes in the training data."""
        return self.scenes or TrainedOn.of_scenarios(self.scenarios)

    @property
    def dim(self) -> int:
        """Dimension D."""
        return self.trained_on.dim

    @property
    def obstacles(self) -> bool:
        """Whether the network sees obstacles: there are some in its training data."""
        return self.trained_on.obstacles

    def clipped(self, seconds: float) -> float:
        """Return the time nearest to `seconds` among those that the network is trained on [s]."""
        return min(max(seconds, self.shortest), self.longest)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data that `from_dict` reads."""
        fields = asdict(self)
        if self.scenes is None:
            del fields["scenes"]
        return {**fields, "features": FEATURES_VERSION}

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
        scenes = plain.pop("scenes", None)
        own = None if scenes is None else TrainedOn.from_dict(scenes, where=where)
        return cls(**plain, scenes=own)

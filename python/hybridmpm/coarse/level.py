"""`CoarseLevel`: how coarse MPM simulates one scene."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from hybridmpm.coarse.merging import checked_ratio, coarse_resolution
from hybridmpm.errors import ConfigError
from hybridmpm.scene import Scene


@dataclass(frozen=True, kw_only=True)
class CoarseLevel:
    """Settings of coarse MPM for one scene, and of the particles that it carries.

    The core checks the ranges of `resolution`, `cfl`, `affine_share` and `relaxation`.
    """

    name: str | None
    """Name in the table of fitted levels, such as "1/16"; None where nothing was fitted."""
    r_p: float
    """Ratio of the particles that are simulated to those of the scene, in (0, 1]."""
    resolution: int
    """Grid cells per metre."""
    moduli: tuple[float, ...]
    """For each of the scene's materials the factor, in (0, 1], on its elastic moduli [-]."""
    cfl: float | None = None
    """CFL number of the substeps, in (0, 1]; None for that of each material."""
    affine_share: float = 0.5
    """Part of the affine motion of the few that those that are carried take over, in [0, 1] [-]."""
    relaxation: float = 2.0
    """How far carried particles slide apart [cells] per density in excess and cell, in [0, 8]."""
    fastest: float | None = None
    """Largest speed of matter that it was fitted to [m/s]; None where nothing was fitted."""

    def __post_init__(self) -> None:
        checked_ratio(self.r_p)
        for factor in self.moduli:
            if not 0 < factor <= 1:
                raise ConfigError(f"the moduli of a coarse level are factors in (0, 1], got {factor!r}")

    @classmethod
    def unfitted(cls, scene: Scene, r_p: float) -> Self:
        """Return the coarse level that keeps a scene's materials and takes the grid that fits the particles."""
        return cls(
            name=None,
            r_p=checked_ratio(r_p),
            resolution=coarse_resolution(scene, r_p),
            moduli=(1.0,) * len(scene.materials),
        )

    def named(self, name: str) -> Self:
        """Return the same settings under a name."""
        return dataclasses.replace(self, name=name)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain data for JSON."""
        return dataclasses.asdict(self) | {"moduli": list(self.moduli)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read what `to_dict` gives; raises a TypeError or a KeyError where fields are wrong."""
        return cls(**{**data, "moduli": tuple(data["moduli"])})

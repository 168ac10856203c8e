"""The constants of a coarse level: where their search begins, their bounds, and the time of a frame."""

from dataclasses import dataclass, fields
from typing import Literal, Self

import numpy as np
import numpy.typing as npt

from hybridmpm.coarse import CoarseLevel, FittedLevel, coarse_resolution
from hybridmpm.scene import Scene
from hybridmpm_lab.fitting.cases import Outcome

RATIOS = {"1/64": 1 / 64, "1/32": 1 / 32, "1/16": 1 / 16, "1/8": 1 / 8, "1/4": 1 / 4}
"""Ratios r_p of the coarse levels by name."""

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Target:
    """A coarse level for one material in one dimension."""

    material: Literal["water", "sand"]
    dim: Literal[2, 3]
    name: str

    @classmethod
    def of(cls, entry: FittedLevel) -> Self:
        """Return the target of a level of a table."""
        return cls(entry.material, entry.dim, entry.name)

    @property
    def scenario(self) -> str:
        """Scenario whose scenes the coarse level is fitted to."""
        return f"{self.material}_{self.dim}d"

    @property
    def r_p(self) -> float:
        """Ratio of the particles."""
        return RATIOS[self.name]

    @property
    def key(self) -> str:
        """Name of the target, for files."""
        return f"{self.scenario}-{self.name.replace('/', '-')}"


TARGETS = tuple(
    Target(material, dim, name) for material in ("water", "sand") for dim in (2, 3) for name in RATIOS
)

_FEWEST_PER_CELL = 1.0  # Smallest number of particles per cell: with fewer, sand comes apart
_LARGEST_CFL = {"water": 0.65, "sand": 1.0}
"""Largest CFL numbers: those measured to be stable are 0.675 and 1.1."""
_NANOSECONDS = {("water", 2): (18, 57, 21), ("sand", 2): (21, 53, 20)} | {
    ("water", 3): (81, 152, 73),
    ("sand", 3): (44, 141, 71),
}
"""Times on one core of an AMD EPYC: of a coarse particle in a substep and in an upsampling, and of a shown
particle in an upsampling."""
_EVERY = 4  # Frames from one upsampling to the next


@dataclass(frozen=True, kw_only=True)
class Constants:
    """One point of the space."""

    particles_per_cell: float
    modulus: float
    cfl: float
    affine_share: float
    relaxation: float

    @classmethod
    def start(cls, target: Target) -> Self:
        """Return the first point of a search.

        A search by hand led there: moduli are lower by the factor by which cells are wider, in 3D a twelfth
        of water's and a quarter of sand's; at the resolution of the scene they are 0.6.
        """
        per_cell = 1.6 if target.dim == 2 else 1.8
        wider = (target.r_p * 2**target.dim / per_cell) ** (1 / target.dim)
        modulus = wider if target.dim == 2 else {"water": 0.08, "sand": 0.25}[target.material]
        if wider > 1:  # The grid is the scene's own: soft matter would only add to the error.
            modulus = 0.6
        return cls(
            particles_per_cell=per_cell,
            modulus=min(1.0, modulus),
            cfl=0.9 * _LARGEST_CFL[target.material],
            affine_share=0.5,
            relaxation=2.0,
        )

    @classmethod
    def at(cls, target: Target, offset: Floats) -> Self:
        """Return the point at an offset (5,) from the start, clipped to the bounds of the space."""
        start, largest = cls.start(target), _LARGEST_CFL[target.material]
        return cls(
            particles_per_cell=_clipped(start.particles_per_cell * np.exp(offset[0]), _FEWEST_PER_CELL, 6.0),
            modulus=_clipped(start.modulus * np.exp(offset[1]), 0.02, 1.0),
            cfl=_clipped(start.cfl + largest * offset[2], 0.5 * largest, largest),
            affine_share=_clipped(start.affine_share + offset[3], 0.0, 1.0),
            relaxation=_clipped(start.relaxation * np.exp(offset[4]), 0.25, 8.0),
        )

    @classmethod
    def of(cls, entry: FittedLevel) -> Self:
        """Return the constants of a coarse level of a table."""
        return cls(**{field.name: getattr(entry, field.name) for field in fields(cls)})

    def level(self, target: Target, scene: Scene) -> CoarseLevel:
        """Return the coarse level of a scene of the target's scenario, unbounded by depth."""
        return CoarseLevel(
            name=target.name,
            r_p=target.r_p,
            resolution=coarse_resolution(scene, target.r_p, self.particles_per_cell),
            moduli=(self.modulus,),
            cfl=self.cfl,
            affine_share=self.affine_share,
            relaxation=self.relaxation,
        )


SCALE = np.array([0.2, 0.5, 0.1, 0.2, 0.5])
"""First standard deviations of the offsets."""


def milliseconds(target: Target, outcome: Outcome, shown: int) -> float:
    """Return the time of a frame [ms] by counted work, which does not depend on the load of the machine."""
    substep, spread, gather = _NANOSECONDS[target.material, target.dim]
    upsampling = outcome.simulated * spread + shown * gather
    return 1e-6 * (outcome.substeps * outcome.simulated * substep + upsampling / _EVERY)


def _clipped(value: float, low: float, high: float) -> float:
    return float(np.clip(value, low, high))

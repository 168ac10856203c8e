"""What bodies are made of: the constants of water, sand and elastic, with their ranges.

The defaults are the reference materials of the engine that the paper used (taichi_elements). Types are
DeepMind's particle types of "Learning to Simulate" (arXiv:2002.09405).
"""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from hybridmpm import _native
from hybridmpm.scene.fields import Range, Record

REFERENCE_BULK_MODULUS = 277_778.0
"""lambda [Pa] of water that states no stiffness: E nu / ((1 + nu)(1 - 2 nu)) with E = 1 MPa, nu = 0.2."""

Density = Annotated[float, Range(0, 1e5, "kg/m^3", open_low=True)]
Modulus = Annotated[float, Range(0, 1e12, "Pa", open_low=True)]
PoissonRatio = Annotated[float, Range(-1, 0.5, open_low=True, open_high=True)]
Friction = Annotated[float, Range(0, 10)]


class Water(Record):
    """Weakly compressible fluid with Cauchy pressure p = lambda (1 - J).

    Stiffness comes from one of two fields: `bulk_modulus` is lambda itself; `max_compression` c asks that
    water at rest be compressed by at most c, i.e. lambda = rho g h / c. Here h is the height of the
    highest point of the scene's water above the floor of the walls, which bounds the depth that it can
    have once settled (impacts compress more). With neither, lambda is `REFERENCE_BULK_MODULUS`.
    """

    kind: Literal["water"] = "water"
    density: Density = Field(1000.0, description="Rest density [kg/m^3].")
    bulk_modulus: Modulus | None = Field(None, description="lambda [Pa]; 277778 if nothing is given.")
    max_compression: Annotated[float, Range(0, 0.5, open_low=True)] | None = Field(
        None, description="Largest 1 - J at rest; sets the bulk modulus from the depth of the scene."
    )
    tension: Annotated[float, Range(0, 1)] = Field(0.25, description="Factor on the stress where J > 1.")
    wall_friction: Friction = Field(0.0, description="Coulomb coefficient against walls and obstacles.")
    volume_correction: bool = Field(
        default=True, description="Lead J back where the density on the grid contradicts it."
    )

    @model_validator(mode="after")
    def _one_stiffness(self) -> "Water":
        if self.bulk_modulus is not None and self.max_compression is not None:
            raise ValueError("give bulk_modulus or max_compression, not both")
        return self

    @property
    def type_id(self) -> int:
        """DeepMind's particle type."""
        return 5

    def stiffness(self, potential_drop: float) -> float:
        """Bulk modulus lambda [Pa] in a scene with this g h.

        Parameters
        ----------
        potential_drop : float
            g h [m^2/s^2] between the floor and the highest water; positive if `max_compression` is used.
        """
        if self.max_compression is not None:
            return self.density * potential_drop / self.max_compression
        return REFERENCE_BULK_MODULUS if self.bulk_modulus is None else self.bulk_modulus

    def to_native(self, potential_drop: float) -> _native.Material:
        """Build the core's material; the argument is that of `stiffness`."""
        return _native.Material.water(
            density=self.density,
            bulk_modulus=self.stiffness(potential_drop),
            tension=self.tension,
            wall_friction=self.wall_friction,
            volume_correction=self.volume_correction,
        )


class Sand(Record):
    """Drucker-Prager sand on StVK-Hencky elasticity (Klar et al. 2016)."""

    kind: Literal["sand"] = "sand"
    density: Density = Field(1000.0, description="Rest density [kg/m^3].")
    youngs_modulus: Modulus = Field(1e6, description="E [Pa].")
    poisson_ratio: PoissonRatio = Field(0.2, description="nu [-].")
    friction_angle: Annotated[float, Range(0, 90, "degrees", open_low=True, open_high=True)] = Field(
        45.0, description="Internal friction angle [degrees]."
    )
    volume_correction: bool = Field(
        default=True, description="Take back, on recompaction, the volume gained in separation."
    )
    wall_friction: Friction = Field(0.5, description="Coulomb coefficient against walls and obstacles.")

    @property
    def type_id(self) -> int:
        """DeepMind's particle type."""
        return 6

    def to_native(self, _potential_drop: float) -> _native.Material:
        """Build the core's material; sand does not depend on the depth of the scene."""
        return _native.Material.sand(
            density=self.density,
            youngs_modulus=self.youngs_modulus,
            poisson_ratio=self.poisson_ratio,
            friction_angle=self.friction_angle,
            wall_friction=self.wall_friction,
            volume_correction=self.volume_correction,
        )


class Elastic(Record):
    """Fixed-corotated solid (Stomakhin et al. 2012); the defaults are those of taichi_elements' jelly."""

    kind: Literal["elastic"] = "elastic"
    density: Density = Field(1000.0, description="Rest density [kg/m^3].")
    youngs_modulus: Modulus = Field(3e5, description="E [Pa].")
    poisson_ratio: PoissonRatio = Field(0.2, description="nu [-].")
    wall_friction: Friction = Field(0.5, description="Coulomb coefficient against walls and obstacles.")

    @property
    def type_id(self) -> int:
        """DeepMind's particle type (goop)."""
        return 7

    def to_native(self, _potential_drop: float) -> _native.Material:
        """Build the core's material; it does not depend on the depth of the scene."""
        return _native.Material.elastic(
            density=self.density,
            youngs_modulus=self.youngs_modulus,
            poisson_ratio=self.poisson_ratio,
            wall_friction=self.wall_friction,
        )


def _from_name(value: object) -> object:
    """Let "water" stand for {"kind": "water"}."""
    return {"kind": value} if isinstance(value, str) else value


Material = Annotated[Water | Sand | Elastic, Field(discriminator="kind"), BeforeValidator(_from_name)]
"""A material object, or its kind alone for the reference constants."""

"""Materials of bodies: the constants of water, sand and elastic solids, with their ranges.

The default constants are those of the engine that the paper used (taichi_elements), here called the
reference materials. Sand alone has its density and stiffness 1.6 times as high, so that it moves the same
and sinks in water. Type ids are DeepMind's particle types of "Learning to Simulate" (arXiv:2002.09405).
"""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from hybridmpm import _core
from hybridmpm.scene.fields import Range, Record

REFERENCE_BULK_MODULUS = 277_778.0
"""lambda [Pa] of water that is given no stiffness: E nu / ((1 + nu)(1 - 2 nu)) with E = 1 MPa, nu = 0.2."""

Density = Annotated[float, Range(0, 1e5, "kg/m^3", open_low=True)]
Modulus = Annotated[float, Range(0, 1e12, "Pa", open_low=True)]
PoissonRatio = Annotated[float, Range(-1, 0.5, open_low=True, open_high=True)]
Friction = Annotated[float, Range(0, 10)]


class Water(Record):
    """Weakly compressible fluid with Cauchy pressure p = lambda (1 - J).

    The stiffness comes from one of two fields. `bulk_modulus` is lambda itself. `max_compression` c is the
    largest compression of water at rest, so lambda = rho g h / c. Here h is the height of the highest
    water at the start above the floor of the walls, because settled water is never deeper. Impacts may
    compress the water by more than c. With neither field, lambda is `REFERENCE_BULK_MODULUS`.
    """

    kind: Literal["water"] = "water"
    density: Density = Field(1000.0, description="Rest density [kg/m^3].")
    bulk_modulus: Modulus | None = Field(
        None, description="Bulk modulus lambda [Pa]; 277778 if max_compression is absent, too."
    )
    max_compression: Annotated[float, Range(0, 0.5, open_low=True)] | None = Field(
        None,
        description="Largest compression 1 - J of the water at rest [-]. The bulk modulus then follows from "
        "the height of the scene's water. Not together with bulk_modulus.",
    )
    tension: Annotated[float, Range(0, 1)] = Field(
        0.25, description="Factor on the stress of stretched water, J > 1 [-]; 0 allows no tension."
    )
    wall_friction: Friction = Field(
        0.0, description="Coulomb coefficient of the water against walls and obstacles [-]."
    )
    volume_correction: bool = Field(
        default=True,
        description="Whether a particle's J is led back to the room that it takes, where the two disagree.",
    )

    @model_validator(mode="after")
    def _one_stiffness(self) -> "Water":
        if self.bulk_modulus is not None and self.max_compression is not None:
            raise ValueError("give bulk_modulus or max_compression, not both")
        return self

    @property
    def type_id(self) -> int:
        """DeepMind's number of this particle type."""
        return 5

    def stiffness(self, potential_drop: float) -> float:
        """Return the bulk modulus lambda [Pa] that this water has in a scene.

        Parameters
        ----------
        potential_drop : float
            `Scene.potential_drop`, the product g h [m^2/s^2]; positive if `max_compression` is given.
        """
        if self.max_compression is not None:
            return self.density * potential_drop / self.max_compression
        return REFERENCE_BULK_MODULUS if self.bulk_modulus is None else self.bulk_modulus

    def softened(self, factor: float, potential_drop: float) -> "Water":
        """Return water of `factor` times the bulk modulus; `potential_drop` as in `stiffness`."""
        softer = factor * self.stiffness(potential_drop)
        return self.model_copy(update={"bulk_modulus": softer, "max_compression": None})

    def to_native(self, potential_drop: float) -> _core.Material:
        """Build the core's material; `potential_drop` as in `stiffness`."""
        return _core.Material.water(
            density=self.density,
            bulk_modulus=self.stiffness(potential_drop),
            tension=self.tension,
            wall_friction=self.wall_friction,
            volume_correction=self.volume_correction,
        )


class Sand(Record):
    """Drucker-Prager sand on StVK-Hencky elasticity (Klar et al. 2016)."""

    kind: Literal["sand"] = "sand"
    density: Density = Field(1600.0, description="Density of the heap, with the air between grains [kg/m^3].")
    youngs_modulus: Modulus = Field(1.6e6, description="Young's modulus E [Pa].")
    poisson_ratio: PoissonRatio = Field(0.2, description="Poisson's ratio nu [-].")
    friction_angle: Annotated[float, Range(0, 90, "degrees", open_low=True, open_high=True)] = Field(
        45.0,
        description="Friction angle of the sand in triaxial compression [degrees]. In 2D, where "
        "strain is plane, 30 act as 27.5, 45 as 45.4.",
    )
    volume_correction: bool = Field(
        default=True,
        description="Whether sand that is compacted again first loses the volume gained in separation, and "
        "what a particle holds for its volume is led back to the room that it takes.",
    )
    wall_friction: Friction = Field(
        0.5, description="Coulomb coefficient of the sand against walls and obstacles [-]."
    )

    @property
    def type_id(self) -> int:
        """DeepMind's number of this particle type."""
        return 6

    def softened(self, factor: float, _potential_drop: float) -> "Sand":
        """Return sand of `factor` times Young's modulus."""
        return self.model_copy(update={"youngs_modulus": factor * self.youngs_modulus})

    def to_native(self, _potential_drop: float) -> _core.Material:
        """Build the core's material; sand does not depend on `Scene.potential_drop`."""
        return _core.Material.sand(
            density=self.density,
            youngs_modulus=self.youngs_modulus,
            poisson_ratio=self.poisson_ratio,
            friction_angle=self.friction_angle,
            wall_friction=self.wall_friction,
            volume_correction=self.volume_correction,
        )


class Elastic(Record):
    """Fixed-corotated solid (Stomakhin et al. 2012); the default constants are taichi_elements' jelly."""

    kind: Literal["elastic"] = "elastic"
    density: Density = Field(1000.0, description="Rest density [kg/m^3].")
    youngs_modulus: Modulus = Field(3e5, description="Young's modulus E [Pa].")
    poisson_ratio: PoissonRatio = Field(0.2, description="Poisson's ratio nu [-].")
    wall_friction: Friction = Field(
        0.5, description="Coulomb coefficient of the solid against walls and obstacles [-]."
    )

    @property
    def type_id(self) -> int:
        """DeepMind's number of this particle type (goop)."""
        return 7

    def softened(self, factor: float, _potential_drop: float) -> "Elastic":
        """Return a solid of `factor` times Young's modulus."""
        return self.model_copy(update={"youngs_modulus": factor * self.youngs_modulus})

    def to_native(self, _potential_drop: float) -> _core.Material:
        """Build the core's material; an elastic solid does not depend on `Scene.potential_drop`."""
        return _core.Material.elastic(
            density=self.density,
            youngs_modulus=self.youngs_modulus,
            poisson_ratio=self.poisson_ratio,
            wall_friction=self.wall_friction,
        )


def _from_name(value: object) -> object:
    """Return {"kind": "water"} for "water"."""
    return {"kind": value} if isinstance(value, str) else value


Material = Annotated[Water | Sand | Elastic, Field(discriminator="kind"), BeforeValidator(_from_name)]
"""A material object; its kind alone ("water") is the reference material of this kind."""

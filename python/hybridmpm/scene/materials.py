"""Materials of bodies: the constants of water, viscous liquids, sand and elastic solids, with their ranges.

The default constants are those of the engine that the paper used (taichi_elements), here called the
reference materials. Sand alone has its density and stiffness 1.6 times as high, so that it moves the same
and sinks in water. Type ids are DeepMind's particle types of "Learning to Simulate" (arXiv:2002.09405).
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from hybridmpm import _core
from hybridmpm._support.suggestions import did_you_mean
from hybridmpm.scene.fields import Range, Record

REFERENCE_BULK_MODULUS = 277_778.0
"""lambda [Pa] of water that is given no stiffness: E nu / ((1 + nu)(1 - 2 nu)) with E = 1 MPa, nu = 0.2."""

Density = Annotated[float, Range(0, 1e5, "kg/m^3", open_low=True)]
Modulus = Annotated[float, Range(0, 1e12, "Pa", open_low=True)]
PoissonRatio = Annotated[float, Range(-1, 0.5, open_low=True, open_high=True)]
Friction = Annotated[float, Range(0, 10)]


class Fluid(Record):
    """Fields and stiffness that water and viscous liquids have in common: Cauchy pressure p = lambda (1 - J).

    The stiffness comes from one of two fields. `bulk_modulus` is lambda itself. `max_compression` c is the
    largest compression of the fluid at rest, so lambda = rho g h / c. Here h is the height of the highest
    fluid at the start above the floor of the walls, because what has settled is never deeper. Impacts may
    compress the fluid by more than c. With neither field, lambda is `REFERENCE_BULK_MODULUS`.
    """

    kind: str
    density: Density = Field(1000.0, description="Rest density [kg/m^3].")
    bulk_modulus: Modulus | None = Field(
        None, description="Bulk modulus lambda [Pa]; 277778 if max_compression is absent, too."
    )
    max_compression: Annotated[float, Range(0, 0.5, open_low=True)] | None = Field(
        None,
        description="Largest compression 1 - J of the fluid at rest [-]. The bulk modulus then follows from "
        "the height of the scene's fluids. Not together with bulk_modulus.",
    )
    tension: Annotated[float, Range(0, 1)] = Field(
        0.25, description="Factor on the pressure of stretched fluid, J > 1 [-]; 0 allows no tension."
    )
    wall_friction: Friction
    volume_correction: bool = Field(
        default=True,
        description="Whether a particle's J is led back to the room that it takes, where the two disagree.",
    )

    @model_validator(mode="after")
    def _one_stiffness(self) -> Self:
        if self.bulk_modulus is not None and self.max_compression is not None:
            raise ValueError("give bulk_modulus or max_compression, not both")
        return self

    def stiffness(self, potential_drop: float) -> float:
        """Return the bulk modulus lambda [Pa] that this fluid has in a scene.

        Parameters
        ----------
        potential_drop : float
            `Scene.potential_drop`, the product g h [m^2/s^2]; positive if `max_compression` is given.
        """
        if self.max_compression is not None:
            return self.density * potential_drop / self.max_compression
        return REFERENCE_BULK_MODULUS if self.bulk_modulus is None else self.bulk_modulus

    def softened(self, factor: float, potential_drop: float) -> Self:
        """Return fluid of `factor` times the bulk modulus; `potential_drop` as in `stiffness`."""
        softer = factor * self.stiffness(potential_drop)
        return self.model_copy(update={"bulk_modulus": softer, "max_compression": None})


class Water(Fluid):
    """Weakly compressible fluid without viscosity."""

    kind: Literal["water"] = "water"
    wall_friction: Friction = Field(
        0.0, description="Coulomb coefficient of the water against walls and obstacles [-]."
    )

    @property
    def type_id(self) -> int:
        """DeepMind's number of this particle type."""
        return 5

    def to_native(self, potential_drop: float) -> _core.Material:
        """Build the core's material; `potential_drop` as in `stiffness`."""
        return _core.Material.water(
            density=self.density,
            bulk_modulus=self.stiffness(potential_drop),
            tension=self.tension,
            wall_friction=self.wall_friction,
            volume_correction=self.volume_correction,
        )


class Liquid(Fluid):
    """Weakly compressible liquid that flows by the law of Herschel and Bulkley (1926), tau = tau_y + K g^n.

    Here tau is the shear stress [Pa] and g the shear rate [1/s]. Stresses below tau_y do not make the liquid
    flow. With n = 1 it is Newtonian, or a Bingham liquid if tau_y > 0; with n < 1 it thins as it is sheared.
    """

    kind: Literal["liquid"] = "liquid"
    viscosity: Annotated[float, Range(0, 1e9, "Pa s^n", open_low=True)] = Field(
        1.0, description="Viscosity K [Pa s]; with another flow_index than 1 the consistency [Pa s^n]."
    )
    yield_stress: Annotated[float, Range(0, 1e9, "Pa")] = Field(
        0.0, description="Shear stress tau_y [Pa] up to which it does not flow."
    )
    flow_index: Annotated[float, Range(0.2, 2)] = Field(
        1.0,
        description="Exponent n of the shear rate [-]; below 1 it thins as it is sheared, above it thickens.",
    )
    wall_friction: Friction = Field(
        10.0,
        description="Coulomb coefficient of the liquid against walls and obstacles [-]; with 10 it does not "
        "slip on what it is pressed on.",
    )

    @property
    def type_id(self) -> int:
        """Number of this particle type: the first that DeepMind's types, 0 to 7, leave free."""
        return 8

    def to_native(self, potential_drop: float) -> _core.Material:
        """Build the core's material; `potential_drop` as in `stiffness`."""
        return _core.Material.liquid(
            density=self.density,
            bulk_modulus=self.stiffness(potential_drop),
            viscosity=self.viscosity,
            yield_stress=self.yield_stress,
            flow_index=self.flow_index,
            tension=self.tension,
            wall_friction=self.wall_friction,
            volume_correction=self.volume_correction,
        )


LIQUIDS: Mapping[str, Liquid] = MappingProxyType(
    {
        # Clover honey with 16 % of water at 20 C: Bogdanov, "Physical properties of honey", 2011.
        "honey": Liquid(density=1420.0, viscosity=19.0),
        # Olive oil at 20 C: CRC Handbook of Chemistry and Physics; density of Codex Stan 33-1981.
        "oil": Liquid(density=913.0, viscosity=0.084),
        # "Aspen pit 1", 35 % of solids by volume: O'Brien and Julien, J. Hydraul. Eng. 114, 1988, table 2.
        "mud": Liquid(density=1580.0, viscosity=8.2, yield_stress=146.0),
        # Basalt at 1130 C, Makaopuhi lava lake: Shaw et al., Am. J. Sci. 266, 1968.
        "lava": Liquid(density=2700.0, viscosity=700.0, yield_stress=100.0),
    }
)
"""Liquids by name, with published constants; a scene may name them as materials."""


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


_KINDS = ("water", "liquid", "sand", "elastic")


def _from_name(value: object) -> object:
    """Return {"kind": "water"} for "water", and for "honey" the liquid of that name."""
    if not isinstance(value, str):
        return value
    if value not in {*_KINDS, *LIQUIDS}:
        known = [*_KINDS, *LIQUIDS]
        names = ", ".join(repr(name) for name in known)
        raise ValueError(f"must be one of {names}, got {value!r}{did_you_mean(value, known)}")
    return LIQUIDS.get(value, {"kind": value})


Material = Annotated[
    Water | Liquid | Sand | Elastic, Field(discriminator="kind"), BeforeValidator(_from_name)
]
"""A material object; its kind alone ("water") is the reference material of this kind, and a name of `LIQUIDS`
("honey") is that liquid."""

"""Walls: the box that holds a scene."""

from typing import Self

from pydantic import Field, model_validator

from hybridmpm.scene.fields import Point, Record, disorder, refuse
from hybridmpm.scene.materials import Friction
from hybridmpm.scene.obstacles import Contact


class Walls(Record):
    """The box that holds everything, applied at its true position though it lies between grid nodes."""

    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m].")
    contact: Contact = Field("separating", description="What happens to material that touches a wall.")
    friction: Friction | None = Field(
        None, description="Coulomb coefficient of separating walls; each material's own if absent."
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        refuse("Walls", disorder(self.lower, self.upper))
        return self

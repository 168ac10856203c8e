"""Walls: the box that no particle of a scene leaves."""

from typing import Self

from pydantic import Field, model_validator

from hybridmpm.scene.fields import Point, Record, corner_faults, raise_faults
from hybridmpm.scene.materials import Friction
from hybridmpm.scene.obstacles import Contact


class Walls(Record):
    """Box that no particle leaves. It acts at its true position, also where this lies between grid nodes."""

    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m].")
    contact: Contact = Field(
        "separating",
        description="Contact with material. sticky: the material stays where it touches. slip: it slides "
        "along without friction and cannot leave. separating: it may leave, and slides with friction.",
    )
    friction: Friction | None = Field(
        None,
        description="Coulomb coefficient of separating walls [-]; each material's wall_friction if absent.",
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        raise_faults("Walls", corner_faults(self.lower, self.upper))
        return self

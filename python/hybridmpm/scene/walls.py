"""Walls: the box that no particle of a scene leaves."""

from typing import Self

from pydantic import Field, model_validator

from hybridmpm.scene.fields import Fault, Point, Record, corner_faults, raise_faults
from hybridmpm.scene.materials import Friction
from hybridmpm.scene.obstacles import Contact

_AXES = "xyz"
_SIDES = ("lower", "upper")
_KINDS = (
    "sticky: the material stays where it touches. slip: it slides along without friction and cannot leave. "
    "separating: it may leave, and slides with friction."
)


class Wall(Record):
    """Surface of one wall, where it differs from that of the others."""

    contact: Contact | None = Field(
        None, description=f"Contact of this wall with material; that of all walls if absent. {_KINDS}"
    )
    friction: Friction | None = Field(
        None,
        description="Coulomb coefficient of this wall [-]; that of all walls if absent. Only with separating "
        "contact.",
    )


class WallFaces(Record):
    """Surfaces of single walls.."""

    x_lower: Wall | None = Field(None, description="Wall at the smallest x.")
    x_upper: Wall | None = Field(None, description="Wall at the largest x.")
    y_lower: Wall | None = Field(None, description="Wall at the smallest y, the floor.")
    y_upper: Wall | None = Field(None, description="Wall at the largest y, the ceiling.")
    z_lower: Wall | None = Field(None, description="Wall at the smallest z; 3D only.")
    z_upper: Wall | None = Field(None, description="Wall at the largest z; 3D only.")

    def given(self) -> dict[str, Wall]:
        """Return the walls that have a surface of their own, by name."""
        walls = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: wall for name, wall in walls.items() if wall is not None}


class Walls(Record):
    """Box that no particle leaves. It acts at its true position, also where this lies between grid nodes."""

    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m].")
    contact: Contact = Field("separating", description=f"Contact with material. {_KINDS}")
    friction: Friction | None = Field(
        None,
        description="Coulomb coefficient of separating walls [-]; each material's wall_friction if absent.",
    )
    faces: WallFaces | None = Field(
        None,
        description="Walls that differ in contact or friction from the others, by name, such as y_lower for "
        "the floor.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        faults: list[Fault] = list(corner_faults(self.lower, self.upper))
        for name, wall in self._given.items():
            contact = wall.contact or self.contact
            if name[0] not in _AXES[: len(self.lower)]:
                known = ", ".join(f"{axis}_{side}" for axis in _AXES[: len(self.lower)] for side in _SIDES)
                faults.append((("faces", name), f"is no wall in {len(self.lower)}D; these are {known}"))
            elif wall.friction is not None and contact != "separating":
                faults.append((("faces", name, "friction"), f"is only for separating contact, not {contact}"))
        raise_faults("Walls", faults)
        return self

    @property
    def _given(self) -> dict[str, Wall]:
        return {} if self.faces is None else self.faces.given()

    @property
    def surfaces(self) -> list[tuple[Contact, float | None]]:
        """Contact and friction of each of the 2 D walls: lower and upper across x, then across y, and so on.

        A friction of None is the `wall_friction` of the material.
        """
        walls = [
            self._given.get(f"{axis}_{side}", Wall()) for axis in _AXES[: len(self.lower)] for side in _SIDES
        ]
        return [
            (wall.contact or self.contact, self.friction if wall.friction is None else wall.friction)
            for wall in walls
        ]

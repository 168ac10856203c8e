"""Obstacles: solids that stand still or move as they are told."""

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from hybridmpm import _native
from hybridmpm.scene.fields import Direction, Length, Point, Record, disorder, refuse
from hybridmpm.scene.materials import Friction
from hybridmpm.scene.motion import Motion

Contact = Literal["sticky", "slip", "separating"]


class _Obstacle(Record):
    contact: Contact = Field("separating", description="What happens to material that touches it.")
    friction: Friction | None = Field(
        None, description="Coulomb coefficient of separating contact; each material's own if absent."
    )
    motion: Motion | None = Field(None, description="The obstacle stands still if absent.")

    @model_validator(mode="after")
    def _friction_has_effect(self) -> "_Obstacle":
        if self.friction is not None and self.contact != "separating":
            refuse("Obstacle", [(("friction",), f"is only for separating contact, not {self.contact}")])
        return self

    def to_native(self) -> _native.Obstacle:
        """Build the core's obstacle."""
        still = self._at_rest()
        return still if self.motion is None else self.motion.applied_to(still)

    def _at_rest(self) -> _native.Obstacle:
        raise NotImplementedError


class SegmentObstacle(_Obstacle):
    """Ramp: all points within thickness / 2 of the segment."""

    shape: Literal["segment"] = "segment"
    start: Point = Field(description="[m]")
    end: Point = Field(description="[m]")
    thickness: Length = Field(description="[m]")

    @model_validator(mode="after")
    def _has_length(self) -> "SegmentObstacle":
        if self.start == self.end:
            refuse("SegmentObstacle", [(("end",), "must differ from start")])
        return self

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"start": self.start, "end": self.end}

    @property
    def smallest_extent(self) -> float:
        """Thickness of the ramp [m]."""
        return self.thickness

    def _at_rest(self) -> _native.Obstacle:
        return _native.Obstacle.segment(
            self.start, self.end, self.thickness, contact=self.contact, friction=self.friction
        )


class BoxObstacle(_Obstacle):
    """Axis-aligned solid box."""

    shape: Literal["box"] = "box"
    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m].")

    @model_validator(mode="after")
    def _ordered(self) -> "BoxObstacle":
        refuse("BoxObstacle", disorder(self.lower, self.upper))
        return self

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"lower": self.lower, "upper": self.upper}

    @property
    def smallest_extent(self) -> float:
        """Shortest side [m]."""
        return min(b - a for a, b in zip(self.lower, self.upper, strict=True))

    def _at_rest(self) -> _native.Obstacle:
        return _native.Obstacle.box(self.lower, self.upper, contact=self.contact, friction=self.friction)


class BallObstacle(_Obstacle):
    """Solid disc in 2D, ball in 3D."""

    shape: Literal["ball"] = "ball"
    center: Point = Field(description="[m]")
    radius: Length = Field(description="[m]")

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"center": self.center}

    @property
    def smallest_extent(self) -> float:
        """Diameter [m]."""
        return 2 * self.radius

    def _at_rest(self) -> _native.Obstacle:
        return _native.Obstacle.ball(self.center, self.radius, contact=self.contact, friction=self.friction)


class HalfSpaceObstacle(_Obstacle):
    """Everything on the side that `normal` points away from."""

    shape: Literal["half_space"] = "half_space"
    point: Point = Field(description="A point of the surface [m].")
    normal: Direction = Field(description="Points out of the solid; any length but zero.")

    @model_validator(mode="after")
    def _normal_points_somewhere(self) -> "HalfSpaceObstacle":
        if math.hypot(*self.normal) < 1e-6:
            refuse("HalfSpaceObstacle", [(("normal",), "must be at least 1e-6 long")])
        return self

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"point": self.point, "normal": self.normal}

    @property
    def smallest_extent(self) -> float:
        """Infinite: nothing is behind it [m]."""
        return math.inf

    def _at_rest(self) -> _native.Obstacle:
        return _native.Obstacle.half_space(
            self.point, self.normal, contact=self.contact, friction=self.friction
        )


Obstacle = Annotated[
    SegmentObstacle | BoxObstacle | BallObstacle | HalfSpaceObstacle, Field(discriminator="shape")
]

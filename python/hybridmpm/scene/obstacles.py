"""Obstacles: solids that stand still or follow a prescribed motion."""

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from hybridmpm import _core
from hybridmpm.scene.fields import Direction, Length, Point, raise_faults
from hybridmpm.scene.materials import Friction
from hybridmpm.scene.motion import Motion
from hybridmpm.scene.shapes import BallShape, BoxShape, CylinderShape, Segment, Shaped

Contact = Literal["sticky", "slip", "separating"]


class _Obstacle(Shaped):
    contact: Contact = Field(
        "separating",
        description="Contact with material. sticky: the material moves with the obstacle. slip: it slides "
        "along without friction and cannot leave. separating: it may leave, and slides with friction.",
    )
    friction: Friction | None = Field(
        None,
        description="Coulomb coefficient of separating contact [-]; the wall_friction of each material if "
        "absent. Only with separating contact.",
    )
    motion: Motion | None = Field(
        None, description="Prescribed motion of the obstacle; it stands still if absent."
    )

    @model_validator(mode="after")
    def _friction_has_effect(self) -> "_Obstacle":
        if self.friction is not None and self.contact != "separating":
            raise_faults("Obstacle", [(("friction",), f"is only for separating contact, not {self.contact}")])
        return self

    def to_native(self) -> _core.Obstacle:
        """Build the core's obstacle."""
        still = self._at_rest()
        return still if self.motion is None else self.motion.applied_to(still)

    def _at_rest(self) -> _core.Obstacle:
        raise NotImplementedError


class SegmentObstacle(Segment, _Obstacle):
    """Ramp: all points within thickness / 2 of the segment from `start` to `end`."""

    shape: Literal["segment"] = "segment"
    start: Point = Field(description="First end of the segment, D coordinates [m].")
    end: Point = Field(description="Second end of the segment, D coordinates [m].")
    thickness: Length = Field(description="Thickness of the ramp [m].")

    @property
    def smallest_extent(self) -> float:
        """Thickness of the ramp [m]."""
        return self.thickness

    def _at_rest(self) -> _core.Obstacle:
        return _core.Obstacle.segment(
            self.start, self.end, self.thickness, contact=self.contact, friction=self.friction
        )


class BoxObstacle(BoxShape, _Obstacle):
    """Axis-aligned solid box."""

    def _at_rest(self) -> _core.Obstacle:
        return _core.Obstacle.box(self.lower, self.upper, contact=self.contact, friction=self.friction)


class BallObstacle(BallShape, _Obstacle):
    """Solid disc in 2D, ball in 3D."""

    def _at_rest(self) -> _core.Obstacle:
        return _core.Obstacle.ball(self.center, self.radius, contact=self.contact, friction=self.friction)


class CylinderObstacle(CylinderShape, _Obstacle):
    """Solid cylinder with flat ends, 3D only."""

    def _at_rest(self) -> _core.Obstacle:
        return _core.Obstacle.cylinder(
            self.start, self.end, self.radius, contact=self.contact, friction=self.friction
        )


class HalfSpaceObstacle(_Obstacle):
    """Solid that fills everything on the side of a plane, in 2D a line, that `normal` points away from."""

    shape: Literal["half_space"] = "half_space"
    point: Point = Field(description="Any point of the surface, D coordinates [m].")
    normal: Direction = Field(
        description="Vector out of the solid, normal to its surface, D numbers; of any length but zero."
    )

    @model_validator(mode="after")
    def _normal_points_somewhere(self) -> "HalfSpaceObstacle":
        if math.hypot(*self.normal) < 1e-6:
            raise_faults("HalfSpaceObstacle", [(("normal",), "must be at least 1e-6 long")])
        return self

    @property
    def smallest_extent(self) -> float:
        """Infinite [m]: a half space has no far side."""
        return math.inf

    def _at_rest(self) -> _core.Obstacle:
        return _core.Obstacle.half_space(
            self.point, self.normal, contact=self.contact, friction=self.friction
        )


Obstacle = Annotated[
    SegmentObstacle | BoxObstacle | BallObstacle | CylinderObstacle | HalfSpaceObstacle,
    Field(discriminator="shape"),
]

"""Bodies, which become particles, and obstacles, which stand still or move as they are told."""

import math
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from hybridmpm import _native
from hybridmpm.scene.fields import Direction, Fault, Length, Point, Record, Seed, Velocity, refuse
from hybridmpm.scene.materials import Friction, Material
from hybridmpm.scene.motion import Motion

Points = npt.NDArray[np.float64]
Contact = Literal["sticky", "slip", "separating"]


class _Body(Record):
    material: Material
    velocity: Velocity | None = Field(None, description="Initial velocity, D numbers [m/s]; zero if absent.")
    seed: Seed = Field(0, description="Of the jitter of particle positions.")


class Box(_Body):
    """Axis-aligned box of material."""

    shape: Literal["box"] = "box"
    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m].")

    @model_validator(mode="after")
    def _ordered(self) -> "Box":
        refuse("Box", disorder(self.lower, self.upper))
        return self

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner [m]."""
        return np.array(self.lower), np.array(self.upper)

    @property
    def measure(self) -> float:
        """Area in 2D [m^2], volume in 3D [m^3]."""
        return math.prod(b - a for a, b in zip(self.lower, self.upper, strict=True))

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"lower": self.lower, "upper": self.upper}

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, D) lie strictly inside; shape (N,)."""
        lower, upper = self.bounds
        return np.asarray(((x > lower) & (x < upper)).all(axis=1))


class Ball(_Body):
    """Disc in 2D, ball in 3D."""

    shape: Literal["ball"] = "ball"
    center: Point = Field(description="[m]")
    radius: Length = Field(description="[m]")

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the bounding box [m]."""
        center = np.array(self.center)
        return center - self.radius, center + self.radius

    @property
    def measure(self) -> float:
        """Area in 2D [m^2], volume in 3D [m^3]."""
        return math.pi * self.radius**2 if len(self.center) == 2 else 4 / 3 * math.pi * self.radius**3

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"center": self.center}

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, D) lie strictly inside; shape (N,)."""
        inside: npt.NDArray[np.bool_] = ((x - np.array(self.center)) ** 2).sum(axis=1) < self.radius**2
        return inside


class Polygon(_Body):
    """Closed polygon by the even-odd rule, 2D only; it may be concave."""

    shape: Literal["polygon"] = "polygon"
    vertices: Annotated[tuple[Point, ...], Field(min_length=3, max_length=1000)] = Field(
        description="Corners in order [m]; the last joins the first."
    )

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the bounding box [m]."""
        corners = np.array(self.vertices)
        return corners.min(axis=0), corners.max(axis=0)

    @property
    def measure(self) -> float:
        """Area [m^2] by the shoelace formula; exact where the outline does not cross itself."""
        x, y = np.array(self.vertices).T
        return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {f"vertices[{i}]": vertex for i, vertex in enumerate(self.vertices)}

    def contains(self, x: Points) -> npt.NDArray[np.bool_]:
        """Whether points (N, 2) lie inside; shape (N,)."""
        order = np.argsort(x[:, 1])
        across, height = x[order].T
        odd = np.zeros(len(x), dtype=bool)
        corners = np.array(self.vertices)
        for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            # Only these lie beside the edge; a horizontal edge is never crossed by a horizontal ray.
            first, last = np.searchsorted(height, sorted((ay, by)))
            if first < last:
                beside = slice(first, last)
                odd[beside] ^= across[beside] < ax + (height[beside] - ay) * (bx - ax) / (by - ay)
        inside = np.empty_like(odd)
        inside[order] = odd
        return inside


Body = Annotated[Box | Ball | Polygon, Field(discriminator="shape")]


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


def disorder(lower: tuple[float, ...], upper: tuple[float, ...]) -> list[Fault]:
    """Faults of a box whose corners differ in dimension, or which has no extent along some axis."""
    if len(lower) != len(upper):
        return [(("upper",), f"must have as many numbers as lower, {len(lower)}, got {len(upper)}")]
    return [
        (("upper", axis), f"must be above lower[{axis}] = {a:g}, got {b:g}")
        for axis, (a, b) in enumerate(zip(lower, upper, strict=True))
        if not a < b
    ]

"""Shapes of bodies, obstacles and sinks."""

import math
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from hybridmpm.scene.fields import Length, Point, Points, Record, corner_faults, raise_faults


class Shaped(Record):
    """A part of a scene with a place in space."""

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Return the vectors, by field name, that must have as many numbers as the scene has dimensions."""
        found: dict[str, tuple[float, ...]] = {}
        for name, value in self:
            if isinstance(value, tuple) and isinstance(value[0], tuple):
                found |= {f"{name}[{i}]": vector for i, vector in enumerate(value)}
            elif isinstance(value, tuple):
                found[name] = value
        return found


class BoxShape(Shaped):
    """Axis-aligned box."""

    shape: Literal["box"] = "box"
    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m].")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        raise_faults(type(self).__name__, corner_faults(self.lower, self.upper))
        return self

    @property
    def extents(self) -> tuple[float, ...]:
        """Side lengths (D,) [m]."""
        return tuple(b - a for a, b in zip(self.lower, self.upper, strict=True))

    @property
    def measure(self) -> float:
        """Area in 2D [m^2], volume in 3D [m^3]."""
        return math.prod(self.extents)

    @property
    def smallest_extent(self) -> float:
        """Shortest side of the box [m]."""
        return min(self.extents)


class BallShape(Shaped):
    """Disc in 2D, ball in 3D."""

    shape: Literal["ball"] = "ball"
    center: Point = Field(description="Centre of the ball, D coordinates [m].")
    radius: Length = Field(description="Radius of the ball [m].")

    @property
    def measure(self) -> float:
        """Area in 2D [m^2], volume in 3D [m^3]."""
        return math.pi * self.radius**2 if len(self.center) == 2 else 4 / 3 * math.pi * self.radius**3

    @property
    def smallest_extent(self) -> float:
        """Diameter of the ball [m]."""
        return 2 * self.radius


class Segment(Shaped):
    """Straight line between two points."""

    shape: str
    start: Point
    end: Point

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        if self.start == self.end:
            raise_faults(type(self).__name__, [(("end",), "must differ from start")])
        return self

    @property
    def length(self) -> float:
        """Distance of the ends [m]."""
        return math.dist(self.start, self.end)

    @property
    def direction(self) -> Points:
        """Unit vector (D,) from start to end."""
        return np.asarray(np.subtract(self.end, self.start) / self.length)


class CylinderShape(Segment):
    """Cylinder with flat ends, 3D only."""

    shape: Literal["cylinder"] = "cylinder"
    start: Point = Field(description="Centre of one end, D coordinates [m].")
    end: Point = Field(description="Centre of the other end, D coordinates [m].")
    radius: Length = Field(description="Radius of the cylinder [m].")

    @property
    def smallest_extent(self) -> float:
        """Diameter of the cylinder or distance of its ends, the smaller one [m]."""
        return min(2 * self.radius, self.length)

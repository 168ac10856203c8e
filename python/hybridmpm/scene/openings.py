"""Emitters and sinks: where material comes into a scene, and where it leaves."""

import math
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from hybridmpm import _native
from hybridmpm.scene.fields import (
    Fault,
    Length,
    Point,
    Points,
    Range,
    Record,
    Seed,
    Velocity,
    disorder,
    refuse,
)
from hybridmpm.scene.materials import Material

EmitterStatus = Literal["waiting", "running", "blocked", "full", "ended"]
"""What an emitter did in the latest frame.

"waiting": it has not started; "running"; "blocked": material or an obstacle is in its way; "full": the scene
holds `max_particles`; "ended": it has stopped.
"""

Time = Annotated[float, Range(0, 1e6, "s")]


class ParticleLimitWarning(UserWarning):
    """An emitter has stopped because the scene holds `max_particles`."""


class _Emitter(Record):
    material: Material
    velocity: Velocity = Field(description="Of the material that leaves the opening, D numbers [m/s].")
    start: Time = Field(0.0, description="When the material begins to come [s].")
    stop: Time | None = Field(None, description="When it ends [s]; never if absent.")
    seed: Seed = Field(0, description="Of the jitter of particle positions.")

    @model_validator(mode="after")
    def _flows(self) -> "_Emitter":
        faults: list[Fault] = []
        if not any(self.velocity):
            faults.append((("velocity",), "must not be zero"))
        if self.stop is not None and self.stop <= self.start:
            faults.append((("stop",), f"must be above start = {self.start:g}, got {self.stop:g}"))
        refuse("Emitter", faults)
        return self

    @property
    def speed(self) -> float:
        """Of the material [m/s]."""
        return math.hypot(*self.velocity)

    @property
    def direction(self) -> Points:
        """Unit vector of the velocity (D,)."""
        return np.array(self.velocity) / self.speed

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the opening's bounding box [m]."""
        raise NotImplementedError

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        raise NotImplementedError

    def sites(self, spacing: float) -> Points:
        """Points (n, D) of the opening [m], as many side by side as fit at this distance [m]."""
        raise NotImplementedError


class RectangularEmitter(_Emitter):
    """Opening from `lower` to `upper`, flat along the velocity: a line in 2D, a rectangle in 3D."""

    shape: Literal["rectangle"] = "rectangle"
    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m]; equal along the velocity.")

    @model_validator(mode="after")
    def _is_flat(self) -> "RectangularEmitter":
        if len({len(self.lower), len(self.upper), len(self.velocity)}) > 1:
            text = "must have as many numbers as upper and velocity"
            refuse("RectangularEmitter", [(("lower",), text)])
        if sum(v != 0 for v in self.velocity) > 1:
            text = "must be along one axis; a round emitter may point anywhere"
            refuse("RectangularEmitter", [(("velocity",), text)])
        pairs = zip(self.lower, self.upper, self.velocity, strict=True)
        for axis, (a, b, v) in enumerate(pairs):
            if (a == b) != (v != 0) or a > b:
                allowed = f"equal to lower[{axis}] = {a:g}" if v else f"above lower[{axis}] = {a:g}"
                text = f"must be {allowed}, because velocity[{axis}] is {v:g}, got {b:g}"
                refuse("RectangularEmitter", [(("upper", axis), text)])
        return self

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner [m]."""
        return np.array(self.lower), np.array(self.upper)

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"lower": self.lower, "upper": self.upper, "velocity": self.velocity}

    def sites(self, spacing: float) -> Points:
        """Points (n, D) of the opening [m], as many side by side as fit at this distance [m]."""
        middle, extent = (np.array(self.lower) + self.upper) / 2, np.subtract(self.upper, self.lower)
        offsets = [_row(length, spacing) for length in extent]
        return middle + np.stack(np.meshgrid(*offsets, indexing="ij"), axis=-1).reshape(-1, len(middle))


class RoundEmitter(_Emitter):
    """Round opening square to the velocity: a disc in 3D, a line in 2D."""

    shape: Literal["round"] = "round"
    center: Point = Field(description="[m]")
    radius: Length = Field(description="[m]")

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the opening's bounding box [m]."""
        reach = self.radius * np.sqrt(np.maximum(1.0 - self.direction**2, 0.0))
        return self.center - reach, self.center + reach

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"center": self.center, "velocity": self.velocity}

    def sites(self, spacing: float) -> Points:
        """Points (n, D) of the opening [m], as many side by side as fit at this distance [m]."""
        row = _row(2 * self.radius, spacing)
        across = _across(self.direction)
        offsets = np.stack(np.meshgrid(*[row] * len(across), indexing="ij"), axis=-1)
        offsets = offsets.reshape(-1, len(across))
        offsets = offsets[np.linalg.norm(offsets, axis=1) < self.radius]
        return np.asarray(np.array(self.center) + offsets @ across)


Emitter = Annotated[RectangularEmitter | RoundEmitter, Field(discriminator="shape")]


class BoxSink(Record):
    """Axis-aligned box: particles that end a frame inside of it are removed."""

    shape: Literal["box"] = "box"
    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(description="Corner with the largest coordinates [m].")

    @model_validator(mode="after")
    def _ordered(self) -> "BoxSink":
        refuse("BoxSink", disorder(self.lower, self.upper))
        return self

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"lower": self.lower, "upper": self.upper}

    def to_native(self) -> _native.Obstacle:
        """Build the core's shape."""
        return _native.Obstacle.box(self.lower, self.upper)


class BallSink(Record):
    """Disc in 2D, ball in 3D: particles that end a frame inside of it are removed."""

    shape: Literal["ball"] = "ball"
    center: Point = Field(description="[m]")
    radius: Length = Field(description="[m]")

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Vectors whose length has to be the scene's dimension, by field name."""
        return {"center": self.center}

    def to_native(self) -> _native.Obstacle:
        """Build the core's shape."""
        return _native.Obstacle.ball(self.center, self.radius)


Sink = Annotated[BoxSink | BallSink, Field(discriminator="shape")]


def _row(length: float, spacing: float) -> npt.NDArray[np.float64]:
    """Points at this spacing, symmetric about 0, whose cells fit into the length; at least one."""
    count = max(1, math.floor(length / spacing + 1e-6))
    return np.asarray((np.arange(count) - (count - 1) / 2) * spacing, dtype=np.float64)


def _across(direction: Points) -> Points:
    """Orthonormal vectors (D - 1, D) square to a unit vector."""
    if len(direction) == 2:
        return np.array([[-direction[1], direction[0]]])
    first: Points = np.cross(direction, np.eye(3)[np.abs(direction).argmin()]).astype(np.float64)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(direction, first)], dtype=np.float64)

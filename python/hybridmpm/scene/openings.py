"""Emitters and sinks: where material comes into a scene, and where it leaves."""

import math
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from hybridmpm import _core
from hybridmpm.scene.fields import (
    Fault,
    Length,
    Point,
    Points,
    Range,
    Seed,
    Velocity,
    raise_faults,
)
from hybridmpm.scene.materials import Material
from hybridmpm.scene.shapes import BallShape, BoxShape, Shaped

EmitterStatus = Literal["waiting", "running", "blocked", "full", "ended"]
"""Status of an emitter in the latest frame.

"waiting": it has not started. "running": its material comes. "blocked": material or an obstacle is in its
way. "full": the scene already has `max_particles` particles. "ended": its time is over.
"""

Time = Annotated[float, Range(0, 1e6, "s")]


class ParticleLimitWarning(UserWarning):
    """An emitter pauses because the scene already has `max_particles` particles."""


class _Emitter(Shaped):
    material: Material
    velocity: Velocity = Field(
        description="Velocity of the material that leaves the opening, D numbers [m/s]; not zero."
    )
    start: Time = Field(0.0, description="Time at which the material begins to come [s].")
    stop: Time | None = Field(
        None, description="Time at which the material ceases to come [s], above start; never if absent."
    )
    seed: Seed = Field(0, description="Seed of the jitter of particle positions.")

    @model_validator(mode="after")
    def _flows(self) -> "_Emitter":
        faults: list[Fault] = []
        if not any(self.velocity):
            faults.append((("velocity",), "must not be zero"))
        if self.stop is not None and self.stop <= self.start:
            faults.append((("stop",), f"must be above start = {self.start:g}, got {self.stop:g}"))
        raise_faults("Emitter", faults)
        return self

    @property
    def speed(self) -> float:
        """Speed of the material that leaves the opening [m/s]."""
        return math.hypot(*self.velocity)

    @property
    def direction(self) -> Points:
        """Unit vector (D,) along the velocity."""
        return np.array(self.velocity) / self.speed

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the opening's bounding box [m]."""
        raise NotImplementedError

    @property
    def measure(self) -> float:
        """Length of the opening in 2D [m], area in 3D [m^2]."""
        raise NotImplementedError

    def sites(self, spacing: float) -> Points:
        """Return the points (n, D) of a layer [m]: they fill the opening, about `spacing` [m] apart."""
        raise NotImplementedError


class RectangularEmitter(_Emitter):
    """Opening perpendicular to one axis: a line in 2D, a rectangle in 3D. The velocity is along this axis."""

    shape: Literal["rectangle"] = "rectangle"
    lower: Point = Field(description="Corner with the smallest coordinates [m].")
    upper: Point = Field(
        description="Corner with the largest coordinates [m]; along the axis of the velocity equal to lower."
    )

    @model_validator(mode="after")
    def _is_flat(self) -> "RectangularEmitter":
        if len({len(self.lower), len(self.upper), len(self.velocity)}) > 1:
            text = "must have as many numbers as upper and velocity"
            raise_faults("RectangularEmitter", [(("lower",), text)])
        if sum(v != 0 for v in self.velocity) > 1:
            text = "must be along one axis; a round emitter may point anywhere"
            raise_faults("RectangularEmitter", [(("velocity",), text)])
        pairs = zip(self.lower, self.upper, self.velocity, strict=True)
        for axis, (a, b, v) in enumerate(pairs):
            if (a == b) != (v != 0) or a > b:
                allowed = f"equal to lower[{axis}] = {a:g}" if v else f"above lower[{axis}] = {a:g}"
                text = f"must be {allowed}, because velocity[{axis}] is {v:g}, got {b:g}"
                raise_faults("RectangularEmitter", [(("upper", axis), text)])
        return self

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the opening [m]."""
        return np.array(self.lower), np.array(self.upper)

    @property
    def measure(self) -> float:
        """Length of the opening in 2D [m], area in 3D [m^2]."""
        return math.prod(b - a for a, b in zip(self.lower, self.upper, strict=True) if b > a)

    def sites(self, spacing: float) -> Points:
        """Return the points (n, D) of a layer [m]: they fill the opening, about `spacing` [m] apart."""
        middle, extent = (np.array(self.lower) + self.upper) / 2, np.subtract(self.upper, self.lower)
        offsets = [_offsets(length, spacing) for length in extent]
        return middle + np.stack(np.meshgrid(*offsets, indexing="ij"), axis=-1).reshape(-1, len(middle))


class RoundEmitter(_Emitter):
    """Round opening perpendicular to the velocity, which may point anywhere: a disc in 3D, a line in 2D."""

    shape: Literal["round"] = "round"
    center: Point = Field(description="Centre of the opening, D coordinates [m].")
    radius: Length = Field(description="Radius of the opening [m].")

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of the opening's bounding box [m]."""
        reach = self.radius * np.sqrt(np.maximum(1.0 - self.direction**2, 0.0))
        return self.center - reach, self.center + reach

    @property
    def measure(self) -> float:
        """Length of the opening in 2D [m], area in 3D [m^2]."""
        return 2 * self.radius if len(self.center) == 2 else math.pi * self.radius**2

    def sites(self, spacing: float) -> Points:
        """Return the points (n, D) of a layer [m]: they fill the opening, about `spacing` [m] apart."""
        row = _offsets(2 * self.radius, spacing)
        across = _across(self.direction)
        offsets = np.stack(np.meshgrid(*[row] * len(across), indexing="ij"), axis=-1)
        offsets = offsets.reshape(-1, len(across))
        offsets = offsets[np.linalg.norm(offsets, axis=1) < self.radius]
        return np.asarray(np.array(self.center) + offsets @ across)


Emitter = Annotated[RectangularEmitter | RoundEmitter, Field(discriminator="shape")]


class BoxSink(BoxShape):
    """Axis-aligned box that removes the particles which end a frame inside of it."""

    def to_native(self) -> _core.Obstacle:
        """Build the core's shape of the sink."""
        return _core.Obstacle.box(self.lower, self.upper)


class BallSink(BallShape):
    """Disc in 2D, ball in 3D, that removes the particles which end a frame inside of it."""

    def to_native(self) -> _core.Obstacle:
        """Build the core's shape of the sink."""
        return _core.Obstacle.ball(self.center, self.radius)


Sink = Annotated[BoxSink | BallSink, Field(discriminator="shape")]


def _offsets(length: float, spacing: float) -> npt.NDArray[np.float64]:
    """Return coordinates that divide `length` evenly, about `spacing` apart and symmetric about 0."""
    count = max(1, round(length / spacing))
    return np.asarray((np.arange(count) - (count - 1) / 2) * (length / count), dtype=np.float64)


def _across(direction: Points) -> Points:
    """Return orthonormal vectors (D - 1, D) perpendicular to a unit vector."""
    if len(direction) == 2:
        return np.array([[-direction[1], direction[0]]])
    first: Points = np.cross(direction, np.eye(3)[np.abs(direction).argmin()]).astype(np.float64)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(direction, first)], dtype=np.float64)

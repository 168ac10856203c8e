"""`Motion`: how an obstacle moves by itself, whatever pushes against it."""

from typing import Annotated, Self

from pydantic import Discriminator, Field, Tag, model_validator

from hybridmpm import _native
from hybridmpm.scene.fields import Fault, Point, Range, Record, Velocity, refuse

_Turn = Annotated[float, Range(-1000, 1000, "rad/s")]
_AngularVelocity = Annotated[
    Annotated[_Turn, Tag("number")] | Annotated[tuple[_Turn, _Turn, _Turn], Tag("vector")],
    Discriminator(lambda value: "vector" if isinstance(value, list | tuple) else "number"),
]


class Motion(Record):
    """Prescribed rigid motion: on and on, or back and forth with a period.

    With the clock s(t) = t, or s(t) = period / (2 pi) (sin(2 pi (t / period + phase)) - sin(2 pi phase))
    where there is a period, the obstacle has moved by `velocity` s and turned by `angular_velocity` s at
    time t. So a swing that starts at phase 0 is in the middle of its stroke and goes
    period / (2 pi) times the velocity to either side.
    """

    velocity: Velocity | None = Field(
        None, description="D numbers [m/s]; zero if absent. Of a swing the largest."
    )
    angular_velocity: _AngularVelocity | None = Field(
        None,
        description="One number in 2D, anticlockwise, three in 3D [rad/s]; zero if absent. Of a swing the "
        "largest.",
    )
    center: Point | None = Field(
        None,
        description="Of rotation at frame 0 [m]; it moves with the velocity. Only with angular_velocity.",
    )
    period: Annotated[float, Range(0, 1e4, "s", open_low=True)] | None = Field(
        None, description="Of a swing [s]; without it the motion goes on and on."
    )
    phase: Annotated[float, Range(0, 1, open_high=True)] = Field(
        0.0,
        description="Where in the period a swing starts: at 0 with full speed, at 0.75 at rest, going forth.",
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        faults: list[Fault] = []
        if self.velocity is None and self.angular_velocity is None:
            faults.append(((), "must have a velocity, an angular_velocity or both"))
        if (self.angular_velocity is None) != (self.center is None):
            needed = (
                "is required with angular_velocity" if self.center is None else "needs an angular_velocity"
            )
            faults.append((("center",), needed))
        if self.phase and self.period is None:
            faults.append((("phase",), "needs a period"))
        refuse("Motion", faults)
        return self

    def dimension_faults(self, dim: int) -> list[Fault]:
        """List what does not fit a scene of `dim` dimensions."""
        faults: list[Fault] = [
            ((name,), f"must have dim = {dim} numbers, got {len(vector)}")
            for name, vector in (("velocity", self.velocity), ("center", self.center))
            if vector is not None and len(vector) != dim
        ]
        turn = self.angular_velocity
        if turn is not None and isinstance(turn, tuple) != (dim == 3):
            faults.append((("angular_velocity",), f"must be {'one number' if dim == 2 else 'three numbers'}"))
        return faults

    def applied_to(self, obstacle: _native.Obstacle) -> _native.Obstacle:
        """Return the core's obstacle in this motion."""
        turn = self.angular_velocity
        return obstacle.moving(
            velocity=self.velocity,
            angular_velocity=[turn] if isinstance(turn, float) else turn,
            center=self.center,
            period=self.period,
            phase=self.phase,
        )

"""`Motion`: the prescribed motion of an obstacle, which nothing that pushes against it can change."""

from typing import Annotated, Self

from pydantic import Discriminator, Field, Tag, model_validator

from hybridmpm import _core
from hybridmpm.scene.fields import Fault, Point, Range, Record, Velocity, is_vector, raise_faults

_TurnRate = Annotated[float, Range(-1000, 1000, "rad/s")]
AngularVelocity = Annotated[
    Annotated[_TurnRate, Tag("number")] | Annotated[tuple[_TurnRate, _TurnRate, _TurnRate], Tag("vector")],
    Discriminator(lambda value: "vector" if is_vector(value) else "number"),
]


class Motion(Record):
    """Prescribed rigid motion of an obstacle: steady, or a swing back and forth with a period.

    At time t the obstacle has moved by `velocity` s(t) and turned by `angular_velocity` s(t). A steady motion
    has s(t) = t, a swing s(t) = period / (2 pi) (sin(2 pi (t / period + phase)) - sin(2 pi phase)). A swing
    of phase 0 starts in the middle of its stroke and reaches period / (2 pi) times the velocity to either
    side.
    """

    velocity: Velocity | None = Field(
        None,
        description="Velocity of the obstacle, D numbers [m/s]; zero if absent. For a swing, its largest "
        "velocity.",
    )
    angular_velocity: AngularVelocity | None = Field(
        None,
        description="Angular velocity of the obstacle [rad/s], in 2D one number, positive anticlockwise, in "
        "3D three; zero if absent. For a swing, its largest angular velocity.",
    )
    center: Point | None = Field(
        None,
        description="Centre of rotation at frame 0, D coordinates [m]; the centre moves with velocity. "
        "Required with angular_velocity, not allowed without.",
    )
    period: Annotated[float, Range(0, 1e4, "s", open_low=True)] | None = Field(
        None, description="Period of a swing [s]. If absent, the motion is steady."
    )
    phase: Annotated[float, Range(0, 1, open_high=True)] = Field(
        0.0,
        description="Fraction of the period at which a swing starts [-]: at 0 the obstacle starts at full "
        "speed, at 0.75 at rest, about to move along velocity.",
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
        raise_faults("Motion", faults)
        return self

    def dimension_faults(self, dim: int) -> list[Fault]:
        """List the vectors whose length does not fit a scene of `dim` dimensions."""
        faults: list[Fault] = [
            ((name,), f"must have dim = {dim} numbers, got {len(vector)}")
            for name, vector in (("velocity", self.velocity), ("center", self.center))
            if vector is not None and len(vector) != dim
        ]
        turn = self.angular_velocity
        if turn is not None and isinstance(turn, tuple) != (dim == 3):
            faults.append((("angular_velocity",), f"must be {'one number' if dim == 2 else 'three numbers'}"))
        return faults

    def applied_to(self, obstacle: _core.Obstacle) -> _core.Obstacle:
        """Return the core's obstacle with this motion."""
        turn = self.angular_velocity
        return obstacle.moving(
            velocity=self.velocity,
            angular_velocity=[turn] if isinstance(turn, float) else turn,
            center=self.center,
            period=self.period,
            phase=self.phase,
        )

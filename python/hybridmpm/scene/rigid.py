"""Rigid bodies: solids that the material moves and that move it."""

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from hybridmpm import _core
from hybridmpm.scene.fields import Fault, Point, Points, Range, Velocity, raise_faults
from hybridmpm.scene.materials import Density, Friction
from hybridmpm.scene.motion import AngularVelocity
from hybridmpm.scene.shapes import BallShape, BoxShape, CylinderShape, Shaped

MOST_BODIES = 200
"""Largest number of rigid bodies in a scene."""
_MOST_CORNERS = 1000
_Angle = Annotated[float, Range(-100, 100, "rad")]
_Rotation = Annotated[
    Annotated[_Angle, Tag("number")] | Annotated[tuple[_Angle, _Angle, _Angle], Tag("vector")],
    Discriminator(lambda value: "vector" if isinstance(value, list | tuple) else "number"),
]


class Rigid(Shaped):
    """A rigid body of any shape."""

    density: Density = Field(500.0, description="Density [kg/m^3].")
    rotation: _Rotation | None = Field(
        None,
        description="Turn about the centre of mass at the start [rad], in 2D one number, positive "
        "anticlockwise, in 3D a vector along the axis of this length; none if absent.",
    )
    velocity: Velocity | None = Field(
        None, description="Velocity of the centre of mass at the start, D numbers [m/s]; zero if absent."
    )
    angular_velocity: AngularVelocity | None = Field(
        None,
        description="Angular velocity at the start [rad/s], in 2D one number, positive anticlockwise, in 3D "
        "three; zero if absent.",
    )
    friction: Friction = Field(
        0.3,
        description="Coulomb coefficient on walls and obstacles [-]; between two rigid bodies the mean of "
        "both counts. Fluids and grains meet the body with their own wall_friction.",
    )
    restitution: Annotated[float, Range(0, 1)] = Field(
        0.0,
        description="Speed of parting over speed of meeting on walls and obstacles [-]; between two rigid "
        "bodies the mean of both counts.",
    )

    def vector_fields(self) -> dict[str, tuple[float, ...]]:
        """Return the vectors that must have as many numbers as the scene has dimensions."""
        turns = ("rotation", "angular_velocity")
        return {name: value for name, value in super().vector_fields().items() if name not in turns}

    def dimension_faults(self, dim: int) -> list[Fault]:
        """List the turns that do not fit a scene of `dim` dimensions."""
        needed = "one number" if dim == 2 else "three numbers"
        turns = {"rotation": self.rotation, "angular_velocity": self.angular_velocity}
        return [
            ((name,), f"must be {needed}")
            for name, turn in turns.items()
            if turn is not None and isinstance(turn, tuple) != (dim == 3)
        ]

    @property
    def mass(self) -> float:
        """Mass [kg], in 2D per metre of depth."""
        return float(self.to_native().mass)

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of a box around the body at the start [m]."""
        raise NotImplementedError

    @property
    def mass_center(self) -> Points:
        """Centre of mass at the start (D,) [m]."""
        return np.asarray(np.mean(np.array(self.bounds), axis=0))

    def _turned(self, arms: Points) -> Points:
        """Turn vectors (N, D) from the centre of mass as the body is turned at the start."""
        if self.rotation is None:
            return arms
        return arms @ rotation_matrix(self.rotation).T

    def moved(self, x: Points, numbers: Points) -> Points:
        """Return where points (N, D) of the body as it is at the start are at another time [m].

        `numbers` (13,) are those of the body then, as `_core.Solver.rigid` has them.
        """
        center, turn = self._placed(numbers)
        return np.asarray((x - self.mass_center) @ turn.T + center)

    def at_start(self, x: Points, numbers: Points) -> Points:
        """Return where points (N, D) of the body at another time are at the start [m]; see `moved`."""
        center, turn = self._placed(numbers)
        return np.asarray((x - center) @ turn + self.mass_center)

    def _placed(self, numbers: Points) -> tuple[Points, Points]:
        """Return the centre of mass (D,) [m] and the matrix (D, D) of the turn since the start."""
        w, x, y, z = numbers[3:7]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        start = self._start_turn()
        dim = len(start)
        return numbers[:dim], turn[:dim, :dim] @ start.T

    def _start_turn(self) -> Points:
        """Return the matrix (D, D) that turns the body's own frame as it is at the start."""
        none = 0.0 if len(self.mass_center) == 2 else (0.0, 0.0, 0.0)
        return rotation_matrix(none if self.rotation is None else self.rotation)

    def solid(self) -> dict[str, Any]:
        """Return the shape in the body's own frame, whose origin is the centre of mass, as plain data [m].

        A box has its `half` sides, a ball its `radius`, a cylinder `radius` and `half` its length along y, a
        hull its `corners`, in 2D anticlockwise, in 3D with `triangles` of three each, anticlockwise from
        outside.
        """
        raise NotImplementedError

    def outline(self) -> Points:
        """Return the corners (K, 2) around the body at the start as seen along z [m], in order."""
        return _around(self._corners()[:, :2])

    def _corners(self) -> Points:
        """Corners (K, D) at the start whose hull is the body [m]; round ones have many."""
        raise NotImplementedError

    def to_native(self) -> _core.RigidBody:
        """Build the core's rigid body."""
        raise NotImplementedError

    def _numbers(self, dim: int) -> dict[str, Any]:
        def listed(turn: float | tuple[float, ...] | None) -> list[float]:
            if turn is None:
                return [0.0] * (1 if dim == 2 else 3)
            return list(turn) if isinstance(turn, tuple) else [turn]

        return {
            "rotation": listed(self.rotation),
            "density": self.density,
            "velocity": self.velocity or (0.0,) * dim,
            "angular_velocity": listed(self.angular_velocity),
            "friction": self.friction,
            "restitution": self.restitution,
        }


def _around(points: Points) -> Points:
    """Return the corners of the convex hull of points (N, 2), anticlockwise."""
    points = np.unique(np.round(points, 12), axis=0)

    def half(order: Points) -> list[Points]:
        chain: list[Points] = []
        for point in order:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-1] - chain[-2], point - chain[-1]
                if ax * by - ay * bx > 0:
                    break
                chain.pop()
            chain.append(point)
        return chain[:-1]

    return np.array(half(points) + half(points[::-1]))


def rotation_matrix(rotation: float | tuple[float, ...]) -> Points:
    """Return the matrix (D, D) of a turn: an angle in 2D, a vector along the axis in 3D [rad]."""
    if not isinstance(rotation, tuple):
        cosine, sine = math.cos(rotation), math.sin(rotation)
        return np.array([[cosine, -sine], [sine, cosine]])
    angle = math.hypot(*rotation)
    if angle == 0:
        return np.eye(3)
    x, y, z = np.array(rotation) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    # Rodrigues' formula.
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


class RigidBox(BoxShape, Rigid):
    """Rigid box, axis-aligned before `rotation`."""

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of a box around the body at the start [m]."""
        middle = (np.array(self.lower) + self.upper) / 2
        half = np.array(self.extents) / 2
        turned = half if self.rotation is None else np.abs(rotation_matrix(self.rotation)) @ half
        return middle - turned, middle + turned

    def _corners(self) -> Points:
        middle = (np.array(self.lower) + self.upper) / 2
        sides = np.stack(np.meshgrid(*[(-1.0, 1.0)] * len(middle)), axis=-1).reshape(-1, len(middle))
        return self._turned(sides * np.array(self.extents) / 2) + middle

    def solid(self) -> dict[str, Any]:
        """Return the half sides; see `Rigid.solid`."""
        return {"shape": self.shape, "half": [side / 2 for side in self.extents]}

    def to_native(self) -> _core.RigidBody:
        """Build the core's rigid body."""
        return _core.RigidBody.box(self.lower, self.upper, **self._numbers(len(self.lower)))


class RigidBall(BallShape, Rigid):
    """Rigid disc in 2D, ball in 3D."""

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of a box around the body [m]."""
        middle = np.array(self.center)
        return middle - self.radius, middle + self.radius

    def _corners(self) -> Points:
        angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return np.array(self.center)[:2] + self.radius * circle

    def solid(self) -> dict[str, Any]:
        """Return the radius; see `Rigid.solid`."""
        return {"shape": self.shape, "radius": self.radius}

    def to_native(self) -> _core.RigidBody:
        """Build the core's rigid body."""
        return _core.RigidBody.ball(self.center, self.radius, **self._numbers(len(self.center)))


class RigidCylinder(CylinderShape, Rigid):
    """Rigid cylinder with flat ends, 3D only."""

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of a box around the body at the start [m]."""
        middle = (np.array(self.start) + self.end) / 2
        half = self._turned((np.array(self.end) - self.start)[None] / 2)[0]
        along = half / np.linalg.norm(half)
        reach = np.abs(half) + self.radius * np.sqrt(np.maximum(0, 1 - along**2))
        return middle - reach, middle + reach

    def _start_turn(self) -> Points:
        # The own axis of a cylinder is y; this turn is the half of the one about the vector between.
        x, y, z = self.direction
        if 1 + y < 1e-9:
            return super()._start_turn() @ np.diag([1.0, -1.0, -1.0])
        cross = np.array([[0, x, 0], [-x, 0, -z], [0, z, 0]])
        lies = np.eye(3) + cross + cross @ cross / (1 + y)
        return np.asarray(super()._start_turn() @ lies)

    def _corners(self) -> Points:
        half = (np.array(self.end) - self.start) / 2
        across = np.linalg.svd(half[None])[2][1:]
        angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
        rim = self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1) @ across
        middle = (np.array(self.start) + self.end) / 2
        return self._turned(np.concatenate([rim - half, rim + half])) + middle

    def solid(self) -> dict[str, Any]:
        """Return radius and half the length; see `Rigid.solid`."""
        return {"shape": self.shape, "radius": self.radius, "half": math.dist(self.start, self.end) / 2}

    def to_native(self) -> _core.RigidBody:
        """Build the core's rigid body."""
        return _core.RigidBody.cylinder(self.start, self.end, self.radius, **self._numbers(len(self.start)))


class RigidHull(Rigid):
    """Convex polygon in 2D, convex polyhedron in 3D: the convex hull of some points."""

    shape: Literal["hull"] = "hull"
    points: Annotated[tuple[Point, ...], Field(min_length=3, max_length=_MOST_CORNERS)] = Field(
        description="Corners in any order [m]; those within the hull of the others count as none."
    )

    @model_validator(mode="after")
    def _encloses(self) -> Self:
        arms = np.array(self.points) - np.mean(np.array(self.points), axis=0)
        spread = np.linalg.svd(arms, compute_uv=False)
        if len(spread) < arms.shape[1] or spread[-1] < 1e-6 * spread[0]:
            needed = "on no common line" if arms.shape[1] == 2 else "in no common plane"
            raise_faults("RigidHull", [(("points",), f"must lie {needed}")])
        return self

    @property
    def mass_center(self) -> Points:
        """Centre of mass at the start (D,) [m]."""
        return np.array(self.to_native().center)

    @property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner of a box around the body at the start [m]."""
        corners = self._corners()
        return corners.min(axis=0), corners.max(axis=0)

    def _corners(self) -> Points:
        center = self.mass_center
        return self._turned(np.array(self.points) - center) + center

    @property
    def smallest_extent(self) -> float:
        """Smallest extent of the points along a principal axis [m]."""
        arms = np.array(self.points) - np.mean(np.array(self.points), axis=0)
        along = arms @ np.linalg.svd(arms)[2].T
        return float(np.ptp(along, axis=0).min())

    def solid(self) -> dict[str, Any]:
        """Return the corners, in 3D with triangles; see `Rigid.solid`."""
        native = self.to_native()
        surface = native.surface()
        if surface is None:
            return {"shape": self.shape, "corners": (_around(np.array(self.points)) - native.center).tolist()}
        corners, triangles = surface
        return {"shape": self.shape, "corners": corners, "triangles": triangles}

    def to_native(self) -> _core.RigidBody:
        """Build the core's rigid body."""
        return _core.RigidBody.hull(self.points, **self._numbers(len(self.points[0])))


RigidBody = Annotated[RigidBox | RigidBall | RigidCylinder | RigidHull, Field(discriminator="shape")]

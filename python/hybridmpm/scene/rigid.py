"""Rigid bodies: solids that the material moves and that move it."""

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Discriminator, Field, Tag, model_validator

from hybridmpm import _core
from hybridmpm.scene.facets import MOST_CORNERS
from hybridmpm.scene.fields import (
    Fault,
    Point,
    Points,
    Range,
    Velocity,
    is_vector,
    raise_faults,
    unequal_faults,
)
from hybridmpm.scene.materials import Density, Friction
from hybridmpm.scene.motion import AngularVelocity
from hybridmpm.scene.shapes import BallShape, BoxShape, CylinderShape, Shaped

MOST_BODIES = 200
"""Largest number of rigid bodies in a scene."""
_Angle = Annotated[float, Range(-100, 100, "rad")]
_Rotation = Annotated[
    Annotated[_Angle, Tag("number")] | Annotated[tuple[_Angle, _Angle, _Angle], Tag("vector")],
    Discriminator(lambda value: "vector" if is_vector(value) else "number"),
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

    def own(self, x: Points) -> Points:
        """Return points (N, D) of the body at the start in its own frame [m]: from the centre, not turned.

        A body with other numbers has them at its centre plus its turn times these.
        """
        return np.asarray((x - self.mass_center) @ self._start_turn())

    def filling(self, spacing: float) -> Points:
        """Return a lattice of points (K, D) that fills the body, in its own frame [m]; K is at least 1."""
        lower, upper = self.bounds
        count = math.ceil(float(np.linalg.norm(upper - lower)) / spacing)
        axis = (np.arange(2 * count + 1) - count) * spacing
        own = np.stack(np.meshgrid(*[axis] * len(lower), indexing="ij"), axis=-1).reshape(-1, len(lower))
        at_start = own @ self._start_turn().T + self.mass_center
        inside = self.to_native().signed_distance(at_start.astype(np.float32)) < 0
        # The middle of a body that is smaller than the lattice is all that there is of it.
        return own[inside | ~own.any(axis=1)]

    def facets(self) -> tuple[Points, npt.NDArray[np.int32]]:
        """Return the surface in the body's own frame: corners (K, D) [m], and those (T, D) of each facet.

        Facets are edges in 2D, triangles in 3D, anticlockwise as seen from outside; round bodies have many.
        """
        if len(self.mass_center) == 3:
            corners, _, triangles = self.mesh()
            return corners, triangles
        corners = self.own(self.outline())
        here = np.arange(len(corners), dtype=np.int32)
        return corners, np.stack([here, np.roll(here, -1)], axis=1)

    def _placed(self, numbers: Points) -> tuple[Points, Points]:
        """Return the centre of mass (D,) [m] and the matrix (D, D) of the turn since the start."""
        start = self._start_turn()
        dim = len(start)
        return numbers[:dim], turn_of(numbers)[:dim, :dim] @ start.T

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

    def mesh(self) -> tuple[Points, Points, npt.NDArray[np.int32]]:
        """Return the surface of a body in 3D as a mesh in the body's own frame.

        Returns
        -------
        float64 (V, 3), float64 (V, 3), int32 (T, 3)
            Vertices [m], unit normals out of the body, and triangles, anticlockwise as seen from outside.
            Flat faces share no vertices, so that edges are sharp.
        """
        raise NotImplementedError

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


def turn_of(numbers: Points) -> Points:
    """Return the matrices (..., 3, 3) of turns from a body's own frame, of numbers (..., 13) of a body."""
    w, x, y, z = np.moveaxis(numbers[..., 3:7], -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def placed(own: Points, numbers: Points) -> Points:
    """Return where points (K, D) of a body's own frame are (..., K, D) [m], by its numbers (..., 13)."""
    dim = own.shape[1]
    turn = turn_of(numbers)[..., :dim, :dim]
    return np.asarray(own @ np.swapaxes(turn, -1, -2) + numbers[..., None, :dim])


def velocities_of(x: Points, numbers: Points) -> Points:
    """Return the velocities (K, D) [m/s] of a body with numbers (13,) at points (K, D) [m]."""
    dim = x.shape[1]
    arms = np.pad(x - numbers[:dim], [(0, 0), (0, 3 - dim)])
    return np.asarray(numbers[7 : 7 + dim] + np.cross(numbers[10:13], arms)[:, :dim])


def _flat(corners: Points, triangles: npt.NDArray[np.int32]) -> tuple[Points, Points, npt.NDArray[np.int32]]:
    """Return a mesh of triangles (T, 3) of corners (V, 3) that share no vertices; see `Rigid.mesh`."""
    vertices = corners[triangles]
    across = np.cross(vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0])
    normals = across / np.linalg.norm(across, axis=1, keepdims=True)
    numbers = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    return vertices.reshape(-1, 3), np.repeat(normals, 3, axis=0), numbers


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


def hull_corners(points: Points) -> Points:
    """Return the corners (K, D) of the convex hull of points (N, D)."""
    if points.shape[1] == 2:
        return _around(points)
    native = RigidHull.model_construct(points=points.tolist()).to_native()
    corners, _ = native.surface() or ([], [])
    return np.array(corners) + native.center


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

    def mesh(self) -> tuple[Points, Points, npt.NDArray[np.int32]]:
        """Return the surface as a mesh; see `Rigid.mesh`."""
        half = np.array(self.extents) / 2
        corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * half
        # The corners are numbered by the signs of z, y and x.
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        triangles = [triangle for a, b, c, d in faces for triangle in ((a, b, c), (a, c, d))]
        return _flat(corners, np.array(triangles, dtype=np.int32))

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

    def mesh(self) -> tuple[Points, Points, npt.NDArray[np.int32]]:
        """Return the surface as a mesh; see `Rigid.mesh`."""
        rings, sides = 24, 48
        down = np.linspace(0, np.pi, rings + 1)[1:-1, None]
        around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        ring = np.stack(
            [np.sin(down) * np.sin(around), np.cos(down) + 0 * around, np.sin(down) * np.cos(around)], axis=-1
        )
        normals = np.concatenate([[[0.0, 1.0, 0.0]], ring.reshape(-1, 3), [[0.0, -1.0, 0.0]]])
        triangles = []
        for side in range(sides):
            after = (side + 1) % sides
            triangles.append((0, 1 + side, 1 + after))
            for upper in range(1, 1 + (rings - 2) * sides, sides):
                a, b, c, d = upper + side, upper + sides + side, upper + sides + after, upper + after
                triangles += [(a, b, c), (a, c, d)]
            last = 1 + (rings - 2) * sides
            triangles.append((last + side, len(normals) - 1, last + after))
        # The polyhedron has the ball's volume.
        faces = np.array(triangles, dtype=np.int32)
        one, two, three = (normals[faces[:, corner]] for corner in range(3))
        volume = np.einsum("ij,ij->", one, np.cross(two, three)) / 6
        return normals * self.radius * (4 / 3 * np.pi / volume) ** (1 / 3), normals, faces

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

    def mesh(self) -> tuple[Points, Points, npt.NDArray[np.int32]]:
        """Return the surface as a mesh; see `Rigid.mesh`."""
        sides, half = 64, float(np.linalg.norm(np.array(self.end) - self.start)) / 2
        around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        out = np.stack([np.sin(around), 0 * around, np.cos(around)], axis=1)
        # The prism has the cylinder's volume.
        radius = self.radius * math.sqrt(2 * math.pi / (sides * math.sin(2 * math.pi / sides)))
        lower, upper = radius * out - [0, half, 0], radius * out + [0, half, 0]
        here = np.arange(sides, dtype=np.int32)
        after = (here + 1) % sides
        sheet = np.concatenate(
            [
                np.stack([here, after, after + sides], axis=1),
                np.stack([here, after + sides, here + sides], axis=1),
            ]
        )
        fan = np.stack([0 * here[1:-1], here[1:-1], after[1:-1]], axis=1)
        up = np.tile([0.0, 1.0, 0.0], (sides, 1))
        return (
            np.concatenate([lower, upper, upper, lower]),
            np.concatenate([out, out, up, -up]),
            np.concatenate([sheet, fan + 2 * sides, fan[:, ::-1] + 3 * sides]).astype(np.int32),
        )

    def to_native(self) -> _core.RigidBody:
        """Build the core's rigid body."""
        return _core.RigidBody.cylinder(self.start, self.end, self.radius, **self._numbers(len(self.start)))


class RigidHull(Rigid):
    """Convex polygon in 2D, convex polyhedron in 3D: the convex hull of some points."""

    shape: Literal["hull"] = "hull"
    points: Annotated[tuple[Point, ...], Field(min_length=3, max_length=MOST_CORNERS)] = Field(
        description="Corners in any order [m]; those within the hull of the others count as none."
    )

    @model_validator(mode="after")
    def _encloses(self) -> Self:
        raise_faults("RigidHull", unequal_faults("points", self.points))
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

    def mesh(self) -> tuple[Points, Points, npt.NDArray[np.int32]]:
        """Return the surface as a mesh; see `Rigid.mesh`."""
        corners, triangles = self.to_native().surface() or ([], [])
        return _flat(np.array(corners), np.array(triangles, dtype=np.int32))

    def to_native(self) -> _core.RigidBody:
        """Build the core's rigid body."""
        return _core.RigidBody.hull(self.points, **self._numbers(len(self.points[0])))


RigidBody = Annotated[RigidBox | RigidBall | RigidCylinder | RigidHull, Field(discriminator="shape")]

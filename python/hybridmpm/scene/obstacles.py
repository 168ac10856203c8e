"""Obstacles: solids that stand still or follow a prescribed motion."""

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from hybridmpm import _core
from hybridmpm.scene.facets import MeshShape, PolygonShape, corners_around, mesh_of
from hybridmpm.scene.fields import Direction, Length, Point, raise_faults
from hybridmpm.scene.materials import Friction
from hybridmpm.scene.motion import Motion
from hybridmpm.scene.rows import Rows
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

    def largest_speed(self, room: tuple[Point, Point]) -> float:
        """Return the largest speed [m/s] of its motion, with its turning at the farthest corner.

        A half space has no corners; those of the `room` (2, D) [m] take their place.
        """
        if self.motion is None:
            return 0.0
        speed = math.hypot(*(self.motion.velocity or (0.0,)))
        if self.motion.angular_velocity is None or self.motion.center is None:
            return speed
        reach = float(np.linalg.norm(np.abs(np.subtract(self.corners(room), self.motion.center)).max(axis=0)))
        reach += getattr(self, "radius", 0.5 * getattr(self, "thickness", 0.0))
        return speed + float(np.linalg.norm(self.motion.angular_velocity)) * reach

    def corners(self, room: tuple[Point, Point]) -> Sequence[Point]:
        """Return points (n, D) [m] at its ends at the start; of a half space those of a `room`."""
        if isinstance(self, PolygonShape | MeshShape):
            return list(self.bounds)
        places = {"lower", "upper", "center", "start", "end"} & self.vector_fields().keys()
        return [getattr(self, name) for name in sorted(places)] or room

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


class PolygonObstacle(PolygonShape, _Obstacle):
    """Solid in a closed polygon, 2D only. It may be concave; what is inside follows the even-odd rule."""

    @classmethod
    def around(
        cls,
        outlines: Sequence[npt.ArrayLike],
        *,
        contact: Contact = "separating",
        friction: float | None = None,
        motion: Motion | None = None,
    ) -> Self:
        """Return the solid that several closed lines enclose; a line within another one makes a hole.

        Parameters
        ----------
        outlines : sequence of float (K, 2), K >= 3
            Closed lines [m], as of `Polygon.around`.
        contact, friction, motion
            As of any obstacle.

        Raises
        ------
        ConfigError
            There is no line, or one is not of this form.
        SceneError
            A value is out of range.
        """
        fields = {"vertices": corners_around(outlines), "contact": contact}
        return cls(**fields, friction=friction, motion=motion)

    def _at_rest(self) -> _core.Obstacle:
        corners = np.array(self.vertices, dtype=np.float32)
        return _core.Obstacle.polygon(corners, contact=self.contact, friction=self.friction)


class MeshObstacle(MeshShape, _Obstacle):
    """Solid within a closed surface of triangles, 3D only. The surface must not cross itself."""

    @classmethod
    def read(
        cls,
        path: str | Path,
        center: Sequence[float],
        height: float,
        *,
        contact: Contact = "separating",
        friction: float | None = None,
        motion: Motion | None = None,
    ) -> Self:
        """Return the solid within the surface of a file, .stl, .obj, .ply or .glb, as of modelling programs.

        Parameters
        ----------
        path, center, height
            As of `Mesh.read`.
        contact, friction, motion
            As of any obstacle.

        Raises
        ------
        ConfigError
            trimesh is not installed (pip install 'hybridmpm[shapes]'), or the ending is another one.
        DataError
            The file cannot be read, or has no triangles.
        SceneError
            The surface is not closed, the message names open edges, or a value is out of range.
        """
        fields = mesh_of(path, center, height) | {"contact": contact}
        return cls(**fields, friction=friction, motion=motion)

    def _at_rest(self) -> _core.Obstacle:
        return _solid(self.vertices, self.triangles, self.contact, self.friction)


@lru_cache(maxsize=16)
def _solid(
    vertices: Rows,
    triangles: Rows,
    contact: Contact,
    friction: float | None,
) -> _core.Obstacle:
    """Build the core's obstacle, which takes a fraction of a second for many triangles."""
    corners, indices = np.asarray(vertices, dtype=np.float32), np.asarray(triangles, dtype=np.uint32)
    return _core.Obstacle.mesh(corners, indices, contact=contact, friction=friction)


Obstacle = Annotated[
    SegmentObstacle
    | BoxObstacle
    | BallObstacle
    | CylinderObstacle
    | HalfSpaceObstacle
    | PolygonObstacle
    | MeshObstacle,
    Field(discriminator="shape"),
]

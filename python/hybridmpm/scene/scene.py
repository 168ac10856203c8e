"""`Scene`: everything that a simulation needs to start, as checked data with JSON and YAML forms.

The world is a box in metres from the origin on, one along each axis if absent, with y up. Times are in
seconds. Every number is checked on construction, so that the rest of the library may trust a scene.
"""

import html
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import yaml
from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator

from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, SceneError
from hybridmpm.scene import files, plain_data
from hybridmpm.scene.bodies import Body
from hybridmpm.scene.drawing import svg
from hybridmpm.scene.fields import Fault, Gravity, Range, Record, raise_faults, scene_error
from hybridmpm.scene.materials import Fluid, Friction, Material
from hybridmpm.scene.obstacles import Obstacle
from hybridmpm.scene.openings import Emitter, Sink
from hybridmpm.scene.rigid import MOST_BODIES, RigidBody
from hybridmpm.scene.sampling import Particles, sample
from hybridmpm.scene.walls import Walls
from hybridmpm.scene.world import World, cells_of, grid_faults, outside

DEFAULT_MAX_PARTICLES = 200_000
ADVISED_LOSS = 100.0
"""Value of `transfer_loss` at which openings pass what they should from two cells on, at 128 cells/m [1/s].

Elsewhere it is in proportion to the resolution.
"""
MIN_CELLS_THICK = 0.5
"""Smallest thickness [cells] of an obstacle that nothing passes through.

A particle that got inside is put back to the nearer surface. At 20 m/s and default substeps it gets less than
half of this far into an obstacle; in a thinner one it could come out on the other side.
"""
_ROUNDING = 1e-9
"""Length [m] by which bounds may reach past a wall: a ball that just touches it does so by rounding."""
MIN_CELLS_BETWEEN_WALLS = 4
"""Smallest distance [cells] of opposite walls, so that no grid node interacts with both."""
_GROUPS = ("bodies", "obstacles", "rigid", "emitters", "sinks")
"""Fields that list parts of a scene."""
_SHAPES_OF_ONE_DIMENSION = {
    ("bodies", "polygon"): (2, "box, ball, cylinder and mesh"),
    ("bodies", "cylinder"): (3, "box, ball and polygon"),
    ("bodies", "mesh"): (3, "box, ball and polygon"),
    ("obstacles", "polygon"): (2, "segment, box, ball, cylinder, half_space and mesh"),
    ("obstacles", "cylinder"): (3, "segment, box, ball, half_space and polygon"),
    ("obstacles", "mesh"): (3, "segment, box, ball, half_space and polygon"),
    ("rigid", "cylinder"): (3, "box, ball and hull"),
}
"""The dimension of shapes that have only one, and the shapes of the other dimension."""


def _by_dim(two: Any, three: Any) -> Any:
    """Return a default factory that gives `two` where the scene's `dim` is 2, else `three`."""
    return lambda fields: two if fields["dim"] == 2 else three


def _whole_world(fields: dict[str, Any]) -> Walls:
    """Return the walls of a scene that names none."""
    dim, world = fields["dim"], fields["world"]
    if world is None or len(world.size) != dim:
        return Walls(lower=(0.1,) * dim, upper=(0.9,) * dim)
    return Walls(lower=(0.0,) * dim, upper=world.size)


class Scene(Record):
    """A world box with walls, bodies, obstacles, emitters, sinks and numerical settings.

    `Scene(...)` and `Scene.parse(...)` raise `SceneError` for anything out of range. The error lists all
    faults, each with the path of its field and the allowed range.
    """

    name: Annotated[str, Field(max_length=200, description="Name of the scene, for people.")] = ""
    dim: Literal[2, 3] = Field(description="Dimension D of the scene.")
    world: World | None = Field(
        None,
        description="Size of the world; one metre along each axis if absent. Cells are cubes in any world.",
    )
    resolution: Annotated[int, Range(1, 1_000_000, "cells")] = Field(
        default_factory=_by_dim(128, 64), description="Grid cells per metre; 128 in 2D, 64 in 3D if absent."
    )
    frame_dt: Annotated[float, Range(0, 0.1, "s", open_low=True)] = Field(
        0.0025, description="Length of a frame [s]."
    )
    gravity: Gravity = Field(
        default_factory=_by_dim((0.0, -9.81), (0.0, -9.81, 0.0)),
        description="Gravity, D numbers [m/s^2]; 9.81 along -y if absent.",
    )
    walls: Walls = Field(
        default_factory=_whole_world,
        description="Box that no particle leaves; if absent, from 0.1 to 0.9 m along each axis, and all of a "
        "world that is given.",
    )
    bodies: Annotated[tuple[Body, ...], Field(max_length=1000)] = Field(
        description="Shapes of material that become particles at the start; at least one in a scene without "
        "emitters."
    )
    contact_friction: Friction | None = Field(
        None,
        description="Coulomb coefficient between an elastic body and any other body [-]; the smaller "
        "wall_friction of the two materials if absent.",
    )
    transfer_loss: Annotated[float, Range(0, 1e6, "1/s")] | None = Field(
        None,
        description="Rate at which particles lose what the grid does not carry of their velocities [1/s], "
        "such as 100 at 128 cells/m and 50 at 64; if absent they lose it in each substep (APIC).",
    )
    obstacles: Annotated[tuple[Obstacle, ...], Field(max_length=1000)] = Field(
        (), description="Solids in the way of the material."
    )
    rigid: Annotated[tuple[RigidBody, ...], Field(max_length=MOST_BODIES)] = Field(
        (), description="Rigid bodies, which the material moves and which move it."
    )
    emitters: Annotated[tuple[Emitter, ...], Field(max_length=100)] = Field(
        (), description="Openings through which material comes into the scene."
    )
    sinks: Annotated[tuple[Sink, ...], Field(max_length=100)] = Field(
        (), description="Shapes in which material leaves the scene."
    )
    frames: Annotated[int, Range(1, 1_000_000)] = Field(
        400, description="Suggested length of a run [frames]."
    )
    particles_per_cell: Annotated[int, Range(1, 64)] = Field(
        default_factory=_by_dim(4, 8), description="Number of particles in a grid cell; 2**D if absent."
    )
    max_particles: Annotated[int, Range(1, 10_000_000)] = Field(
        DEFAULT_MAX_PARTICLES,
        description="Largest number of particles. A scene whose bodies need more is refused; an emitter "
        "pauses while another layer would exceed it.",
    )

    @field_validator("bodies", "obstacles", "rigid", "emitters", "sinks", mode="before")
    @classmethod
    def _listed(cls, value: object) -> object:
        """Refuse a single part, whose fields pydantic would take for items."""
        if isinstance(value, Record):
            raise ValueError(f"must be a list, got a {type(value).__name__}: write it within [ ]")  # noqa: TRY004 - for pydantic
        return value

    @field_validator("world")
    @classmethod
    def _unit_is_none(cls, world: World | None, info: ValidationInfo) -> World | None:
        """Scenes of one metre are equal whether they say so or not."""
        return None if world is not None and world.size == (1.0,) * info.data.get("dim", 0) else world

    @field_validator("resolution")
    @classmethod
    def _fits_the_world(cls, resolution: int, info: ValidationInfo) -> int:
        """Refuse grids that are too coarse or too large together with the other faults of fields."""
        dim, world = info.data.get("dim"), info.data.get("world")
        if dim is not None and "world" in info.data and (world is None or len(world.size) == dim):
            for where, text in grid_faults((1.0,) * dim if world is None else world.size, resolution):
                if where == ("resolution",):
                    raise ValueError(text)
        return resolution

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        raise_faults("Scene", self._dimension_faults())
        raise_faults("Scene", self._world_faults())
        raise_faults("Scene", self._range_faults() + self._body_faults() + self._emitter_faults())
        raise_faults("Scene", self._rigid_faults())
        return self

    def _dimension_faults(self) -> list[Fault]:
        vectors: list[tuple[tuple[str | int, ...], tuple[float, ...]]] = [
            (("gravity",), self.gravity),
            (("walls", "lower"), self.walls.lower),
            (("walls", "upper"), self.walls.upper),
            *([] if self.world is None else [(("world", "size"), self.world.size)]),
        ]
        faults: list[Fault] = []
        for group in _GROUPS:
            for i, part in enumerate(getattr(self, group)):
                where = (group, i, part.shape)
                vectors += [((*where, field), value) for field, value in part.vector_fields().items()]
                allowed = _SHAPES_OF_ONE_DIMENSION.get((group, part.shape))
                if allowed is not None and allowed[0] != self.dim:
                    text = f"{part.shape} is for dim {allowed[0]} only; dim {self.dim} allows {allowed[1]}"
                    faults.append(((*where, "shape"), text))
        for i, obstacle in enumerate(self.obstacles):
            if obstacle.motion is not None:
                wrong = obstacle.motion.dimension_faults(self.dim)
                faults += [
                    (("obstacles", i, obstacle.shape, "motion", *field), text) for field, text in wrong
                ]
        for i, body in enumerate(self.rigid):
            wrong = body.dimension_faults(self.dim)
            faults += [(("rigid", i, body.shape, *field), text) for field, text in wrong]
        return faults + [
            (where, f"must have dim = {self.dim} numbers, got {len(vector)}")
            for where, vector in vectors
            if len(vector) != self.dim
        ]

    def _world_faults(self) -> list[Fault]:
        parts: list[tuple[tuple[str | int, ...], Record]] = [(("walls",), self.walls)]
        for group in _GROUPS:
            parts += [((group, i, part.shape), part) for i, part in enumerate(getattr(self, group))]
        found = ((start, outside(part, self.size)) for start, part in parts)
        return [((*start, *where), text) for start, faults in found for where, text in faults]

    def _range_faults(self) -> list[Fault]:
        faults = grid_faults(self.size, self.resolution)
        needed = MIN_CELLS_BETWEEN_WALLS * self.dx
        for axis, (a, b) in enumerate(zip(self.walls.lower, self.walls.upper, strict=True)):
            if b - a < needed * (1 - 1e-9):
                text = (
                    f"must be at least {MIN_CELLS_BETWEEN_WALLS} cells, {needed:g} m, apart along axis {axis}"
                )
                faults.append((("walls",), f"{text}, got {b - a:g} m"))
        return faults

    def _body_faults(self) -> list[Fault]:
        faults: list[Fault] = []
        if not (self.bodies or self.emitters):
            faults.append(
                (("bodies",), "must have 1 or more items, got 0; only a scene with emitters needs none")
            )
        for i, body in enumerate(self.bodies):
            where = ("bodies", i, body.shape)
            lower, upper = body.bounds
            room_lower, room_upper = np.array(self.walls.lower), np.array(self.walls.upper)
            if (lower < room_lower - _ROUNDING).any() or (upper > room_upper + _ROUNDING).any():
                room, span = _corners(self.walls.lower, self.walls.upper), _corners(lower, upper)
                faults.append((where, f"must lie inside the walls, {room} m, but spans {span} m"))
            faults += self._stiffness_faults(where, body.material)
        needed = sum(body.measure for body in self.bodies) / self.spacing**self.dim
        if needed > self.max_particles:
            allowed = f"[1, {self.max_particles}] (max_particles)"
            faults.append((("bodies",), f"need about {needed:.0f} particles, allowed are {allowed}"))
        return faults

    def _rigid_faults(self) -> list[Fault]:
        faults: list[Fault] = []
        for i, body in enumerate(self.rigid):
            lower, upper = body.bounds
            room_lower, room_upper = np.array(self.walls.lower), np.array(self.walls.upper)
            # A body that rests on a wall may overlap it by what contacts leave.
            slack = _ROUNDING + 1e-3 * body.smallest_extent
            if (lower < room_lower - slack).any() or (upper > room_upper + slack).any():
                room, span = _corners(self.walls.lower, self.walls.upper), _corners(lower, upper)
                text = f"must lie inside the walls, {room} m, but spans {span} m"
                faults.append((("rigid", i, body.shape), text))
        return faults

    def _emitter_faults(self) -> list[Fault]:
        faults: list[Fault] = []
        for i, emitter in enumerate(self.emitters):
            where = ("emitters", i, emitter.shape)
            lower, upper = emitter.bounds
            # A layer appears at the end of a frame, when it may have come this far.
            way = emitter.direction * (self.spacing + emitter.speed * self.frame_dt)
            lower, upper = np.minimum(lower, lower + way), np.maximum(upper, upper + way)
            if (lower < np.array(self.walls.lower) - _ROUNDING).any() or (
                upper > np.array(self.walls.upper) + _ROUNDING
            ).any():
                room, span = _corners(self.walls.lower, self.walls.upper), _corners(lower, upper)
                text = (
                    f"must lie inside the walls, {room} m, with what leaves it in a frame, but spans {span} m"
                )
                faults.append((where, text))
            faults += self._stiffness_faults(where, emitter.material)
        return faults

    def _stiffness_faults(self, where: tuple[str | int, ...], material: Material) -> list[Fault]:
        if isinstance(material, Fluid) and material.max_compression and self.potential_drop <= 0:
            return [((*where, "material", material.kind, "max_compression"), "needs gravity above 0")]
        return []

    @property
    def title(self) -> str:
        """The name, or a title from the dimension where there is none."""
        return self.name or f"{self.dim}D scene"

    def __repr__(self) -> str:
        counts = {
            name: len(getattr(self, name)) for name in ("bodies", "obstacles", "rigid", "emitters", "sinks")
        }
        parts = [f"{name}: {count}" for name, count in counts.items() if count]
        materials = " and ".join(dict.fromkeys(material.kind for material in self.materials))
        return f"Scene({', '.join([self.title, f'{self.dim}D', materials, *parts])})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        openings = (*self.emitters, *self.sinks)
        drawing = svg(self.walls, self.bodies, (*self.obstacles, *self.rigid), openings, 320)
        return (
            f'<figure style="margin: 0">{drawing}<figcaption>{html.escape(repr(self))}</figcaption></figure>'
        )

    def refuse_rigid(self, what: str, reason: str) -> None:
        """Refuse a scene with rigid bodies, by a ConfigError, for what does not know them."""
        if self.rigid:
            raise ConfigError(
                f"{what} not made for rigid bodies, and the scene has {len(self.rigid)}: {reason}. Remove "
                "`rigid`, or use MpmSolver(scene)"
            )

    @property
    def is_open(self) -> bool:
        """Whether particles may come and go."""
        return bool(self.emitters or self.sinks)

    @property
    def size(self) -> tuple[float, ...]:
        """Length of the world along each axis (D,) [m]."""
        return (1.0,) * self.dim if self.world is None else self.world.size

    @property
    def cells(self) -> tuple[int, ...]:
        """Number of grid cells along each axis (D,); the last ones may reach beyond the world."""
        return cells_of(self.size, self.resolution)

    @property
    def dx(self) -> float:
        """Size of a grid cell [m]."""
        return 1.0 / self.resolution

    @property
    def spacing(self) -> float:
        """Mean distance of neighbouring particles at the start [m]."""
        return float(self.dx / self.particles_per_cell ** (1.0 / self.dim))

    @property
    def materials(self) -> tuple[Material, ...]:
        """The distinct materials of the bodies and the emitters, in order of first use."""
        return tuple(dict.fromkeys(part.material for part in (*self.bodies, *self.emitters)))

    def made_of(self, material: Material) -> str:
        """Return the paths of the bodies and emitters of a material, such as "bodies[0], bodies[2]"."""
        parts = (("bodies", self.bodies), ("emitters", self.emitters))
        return ", ".join(
            f"{name}[{place}]"
            for name, group in parts
            for place, owner in enumerate(group)
            if owner.material == material
        )

    @property
    def potential_drop(self) -> float:
        """Product g h [m^2/s^2], where h is the height of the highest fluid above the floor; 0 without one.

        Up is against gravity, whatever its direction. The product is the largest g . x in the box of the
        walls minus the smallest in the bounding boxes of the bodies and openings of water and liquids.
        """
        parts = (*self.bodies, *self.emitters)
        fluid = [part.bounds for part in parts if isinstance(part.material, Fluid)]
        if not fluid:
            return 0.0
        gravity = np.array(self.gravity)
        floor = np.maximum(gravity * self.walls.lower, gravity * self.walls.upper).sum()
        top = min(np.minimum(gravity * lower, gravity * upper).sum() for lower, upper in fluid)
        return float(floor - top)

    def thin_obstacles(self) -> list[str]:
        """Return a message for each obstacle thinner than `MIN_CELLS_THICK` cells; it says what to do."""
        needed = MIN_CELLS_THICK * self.dx
        return [
            f"obstacles[{i}] ({obstacle.shape}) is {obstacle.smallest_extent:.3g} m thick, less than "
            f"{MIN_CELLS_THICK} cells of {self.dx:.3g} m, so fast material may pass through it: "
            f"make it at least {needed:.3g} m thick, or raise the resolution"
            for i, obstacle in enumerate(self.obstacles)
            if obstacle.smallest_extent < needed - _ROUNDING
        ]

    def sample(self) -> "Particles":
        """Fill the bodies with particles; see `hybridmpm.scene.sampling`.

        Raises
        ------
        SceneError
            A body has room for no particle, or the bodies need more than `max_particles`.
        """
        return sample(self)

    @classmethod
    def parse(cls, data: object) -> Self:
        """Make a scene from plain data, e.g. what a JSON parser returned.

        Raises
        ------
        SceneError
            The data are no valid scene. `problems` lists field path and message of each fault.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise scene_error(error) from None

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Read a scene from JSON, in which no key stands twice in one object.

        Raises
        ------
        SceneError
            The text is no such JSON or no valid scene.
        """
        try:
            data = plain_data.from_json(text)
        except ValueError as error:
            raise SceneError(f"the scene is not JSON: {error}") from None
        return cls.parse(data)

    @classmethod
    def from_yaml(cls, text: str | bytes) -> Self:
        """Read a scene from YAML.

        No key stands twice in one mapping, and numbers have no leading zeros and no colons, which YAML would
        read as octal and as base 60.

        Raises
        ------
        SceneError
            The text is no such YAML or no valid scene.
        """
        try:
            data = plain_data.from_yaml(text)
        except ValueError as error:
            raise SceneError(f"the scene is not YAML: {error}") from None
        return cls.parse(data)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a scene from a .json, .yaml or .yml file.

        In it a body or an obstacle may have `file`, `center` and `height` in the place of its shape: that of
        an .stl, .obj, .ply, .glb, .svg or .png file, whose place is relative to that of the scene.

        Raises
        ------
        SceneError
            The file's name has another ending, or its text is no valid scene.
        OSError
            The file cannot be read.
        """
        path = Path(path)
        kind, read = (
            ("JSON", plain_data.from_json) if _suffix(path) == ".json" else ("YAML", plain_data.from_yaml)
        )
        try:
            data = read(path.read_bytes())
        except ValueError as error:
            raise SceneError(f"the scene is not {kind}: {error}") from None
        return cls.parse(files.resolved(data, path.parent))

    def to_json(self) -> str:
        """Return the scene as JSON; `from_json` makes an equal scene of it."""
        return self.model_dump_json(exclude_none=True, indent=2) + "\n"

    def to_yaml(self) -> str:
        """Return the scene as YAML; `from_yaml` makes an equal scene of it."""
        text: str = yaml.safe_dump(
            self.model_dump(mode="json", exclude_none=True), sort_keys=False, default_flow_style=None
        )
        return text

    def save(self, path: str | Path) -> None:
        """Write the scene to a .json, .yaml or .yml file.

        Raises
        ------
        SceneError
            The file's name has another ending.
        ExportError
            The file cannot be written.
        """
        path = Path(path)
        text = self.to_json() if _suffix(path) == ".json" else self.to_yaml()
        with replacing(path) as part:
            part.write_text(text, encoding="utf-8")

    @classmethod
    def json_schema(cls) -> dict[str, Any]:
        """Return the JSON Schema (2020-12) of a scene's JSON and YAML forms."""
        return cls.model_json_schema()


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in {".json", ".yaml", ".yml"}:
        raise SceneError(f"scene files end in .json, .yaml or .yml, got {path.name!r}")
    return suffix


def _corners(lower: Any, upper: Any) -> str:
    return " to ".join("(" + ", ".join(f"{value:g}" for value in corner) + ")" for corner in (lower, upper))

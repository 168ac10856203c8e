"""Origin and inputs of a session: together they determine its state at each frame, to the bit.

Inputs are everything that acts on a session from outside, each with the frame that it acts from. They are
pydantic models, since clients send them, and logs and files contain them. The text below a field describes it
in the OpenAPI document.
"""

from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as Several
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal, Self, TypeAlias, overload

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter

from hybridmpm import SOLVER_VERSION, Scene, __version__
from hybridmpm.control import (
    DEFAULT_CAP,
    MAX_CAP,
    MAX_KEYFRAMES,
    MAX_OUTLINES,
    MAX_POINTS,
    METHODS,
    Arrow,
    Ellipse,
    Fill,
    Keyframe,
    Led,
    Pull,
    Push,
    Sequence,
    Shape,
    Sketch,
    Solid,
    Stroke,
)
from hybridmpm.scene import Triangles, Vertices
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverChoice

MAX_PUSH_SPEED = 100.0
"""Largest speed of a hand along an axis [m/s]."""
Frame = Annotated[int, Field(ge=0)]
FrameCount = Annotated[int, Field(ge=1)]
Cap = Annotated[
    float, Field(gt=0, le=MAX_CAP, description="Largest acceleration of a particle [g = 9.81 m/s^2].")
]


def _known_method(name: str) -> str:
    if name != "auto" and name not in METHODS:
        raise ValueError(f"must be auto, {' or '.join((', '.join([*METHODS][:-1]), [*METHODS][-1]))}")
    return name


class Strict(BaseModel):
    """Base of data from clients: unknown fields, infinite numbers and strings for numbers are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True, use_attribute_docstrings=True)


class OfParticle(Strict):
    """Choice of the body that a particle belongs to."""

    particle: int = Field(ge=0, lt=2**32)
    """Number of the particle."""


WhoField: TypeAlias = (
    Annotated[int, Field(ge=0)] | Literal["water", "sand", "elastic", "liquid"] | OfParticle | Stroke | None
)
"""Choice of the particles that are led."""


class SketchSettings(Strict):
    """Settings of a sketch. An absent one takes its default."""

    method: Annotated[str, AfterValidator(_known_method)] = Field(
        default="auto",
        description=f"Method that plans: auto, or one of {', '.join(METHODS)}.",
        examples=["auto", "constant"],
    )
    frames: FrameCount | None = None
    """Number of frames in which the goal is to be reached; with `hold` at most the setting max_sketch_frames.
    Chosen by the needs of the goal if absent."""
    cap: Cap = DEFAULT_CAP
    strength: float = Field(default=1.0, gt=0, le=1)
    """Factor on `cap`."""
    hold: int = Field(default=0, ge=0)
    """Number of frames for which the goal is kept after it was reached."""
    fill: Fill = "even"
    """Treatment of an oval larger than the fluid: filled evenly (even), or shrunk to the volume of the fluid
    (shrink)."""
    who: WhoField = None
    """Particles that the sketch leads, all of them if absent: the index of a body, a material, the body of a
    particle, or the particles under a stroke."""
    seed: int = Field(default=0, ge=0, lt=2**32)
    """Seed of random numbers of a method."""


class LimitedSettings(SketchSettings):
    """All settings of a sketch that steers: the arguments of `hybridmpm.control.prepare`."""

    most: int = Field(ge=1)
    """Largest number of frames, above that of `hold`."""


class SketchRecord(Strict):
    """A sketch as interpreted; each kind has fields of its own."""

    kind: Literal["arrow", "ellipse", "shape", "solid"]
    """Kind of the sketch."""
    points: list[list[float]] | None = Field(default=None, max_length=MAX_POINTS)
    """Points of an arrow from tail to tip [m]."""
    widths: list[float] | None = Field(default=None, max_length=MAX_POINTS)
    """Width of an arrow's stroke at each point [pixels of 512]."""
    center: list[float] | None = None
    """Centre of an ellipse [m]."""
    axes: list[float] | None = None
    """Semi-axes of an ellipse, major first [m]."""
    angle: float | None = None
    """Angle of the major axis to +x [rad]."""
    outlines: list[list[list[float]]] | None = Field(default=None, max_length=MAX_OUTLINES)
    """Closed lines of a shape [m]."""
    vertices: Vertices | None = None
    """Corners of the triangles of a solid [m], as of a mesh in a scene."""
    triangles: Triangles | None = None
    """Triangles of a solid, three indices of vertices each, all of them the same way round."""
    width: float | None = None
    """Width of the stroke of an ellipse or a shape [pixels of 512]."""
    note: str | None = Field(default=None, max_length=300)
    """How a picture was read, where that is not obvious."""

    @classmethod
    def of(cls, sketch: Sketch) -> Self:
        """Return the record of a sketch."""
        return cls(kind=sketch.kind, **_plain(sketch))

    def sketch(self) -> Sketch:
        """Return the sketch.

        Raises
        ------
        SketchError, TypeError
            The sketch is out of range, or has the fields of the other kind.
        """
        fields = self.model_dump(exclude={"kind"}, exclude_none=True)
        kinds: dict[str, Callable[..., Sketch]] = {
            "arrow": Arrow,
            "ellipse": Ellipse,
            "shape": Shape,
            "solid": Solid,
        }
        return kinds[self.kind](**fields)


class Hand(Strict):
    """A local force, as by a hand that moves through the fluid."""

    point: list[Annotated[float, Field(ge=0, le=4096)]] = Field(min_length=2, max_length=3)
    """Centre [m]."""
    velocity: list[Annotated[float, Field(ge=-MAX_PUSH_SPEED, le=MAX_PUSH_SPEED)]] = Field(
        min_length=2, max_length=3
    )
    """Velocity of the hand [m/s]."""
    radius: float = Field(gt=0, le=4096)
    """Reach of the force [m]."""
    cap: Cap = DEFAULT_CAP

    def force(self) -> Push:
        """Return the force."""
        return Push(np.array(self.point), np.array(self.velocity), self.radius, self.cap)


Metres = Annotated[float, Field(ge=-4096, le=4096)]


class Grip(Strict):
    """A hand that holds a rigid body at a point."""

    body: int = Field(ge=0)
    """Number of the body in the scene."""
    grip: list[Metres] = Field(min_length=2, max_length=3)
    """Point that is held, from the centre of mass, in the body's own frame [m]."""
    target: list[Metres] = Field(min_length=2, max_length=3)
    """Point that it is drawn to [m]."""
    reach: float = Field(gt=0, le=4096)
    """Distance of both at which a spring at rest gives `strength` [m]."""
    strength: float = Field(gt=0, le=1e9)
    """Largest force [N], in 2D per metre of depth."""

    def force(self) -> Pull:
        """Return the force."""
        return Pull(self.body, np.array(self.grip), np.array(self.target), self.reach, self.strength)


@overload
def hand_record(force: None) -> None: ...
@overload
def hand_record(force: Push | Pull) -> Hand | Grip: ...
@overload
def hand_record(force: Push | Pull | None) -> Hand | Grip | None: ...
def hand_record(force: Push | Pull | None) -> Hand | Grip | None:
    """Return the record of a hand's force; None without one."""
    if force is None:
        return None
    return (Grip if isinstance(force, Pull) else Hand)(**_plain(force))


Goals: TypeAlias = Sketch | list[Keyframe]
"""A sketch, or several in turn."""


def check_hand(hand: Hand | Grip, scene: Scene, where: str = "") -> None:
    """Refuse a hand that does not fit a scene; `where` begins the names of its fields.

    Raises
    ------
    FieldError
        A vector has not as many numbers as the scene has dimensions, a point lies outside of the world, or
        there is no such body.
    """
    names = ("grip", "target") if isinstance(hand, Grip) else ("point", "velocity")
    for name in names:
        given = len(getattr(hand, name))
        if given != scene.dim:
            raise FieldError(f"{where}{name}", f"must have {scene.dim} numbers, got {given}")
    if isinstance(hand, Grip):
        bodies = len(scene.rigid)
        if hand.body >= bodies:
            allowed = f"must be less than {bodies}" if bodies else "this session has no rigid bodies"
            raise FieldError(f"{where}body", f"{allowed}, got {hand.body}")
        return
    for axis, (x, length) in enumerate(zip(hand.point, scene.size, strict=True)):
        if x > length:
            text = f"must be less than or equal to {length:g}, got {x:g}"
            raise FieldError(f"{where}point[{axis}]", text)


class KeyframeRecord(Strict):
    """A goal among several, as interpreted."""

    sketch: SketchRecord
    """The sketch of the goal."""
    frames: FrameCount | None = None
    """Number of frames from the goal before to this one. Chosen by the needs of the goal if absent."""
    hold: int = Field(default=0, ge=0, le=10_000)
    """Number of frames for which the goal is kept."""
    who: WhoField = None
    """Particles that are led to it, as of a sketch, chosen in the state at the start."""

    def keyframe(self) -> Keyframe:
        """Return the keyframe. Raises as `SketchRecord.sketch`."""
        who = self.who.model_dump() if isinstance(self.who, BaseModel) else self.who
        return Keyframe(self.sketch.sketch(), self.frames, self.hold, who)


class SketchInput(Strict):
    """A sketch that begins to steer; it replaces an older one."""

    kind: Literal["sketch"] = "sketch"
    """Kind of the input."""
    frame: Frame
    """First frame whose state it acts on."""
    number: int = Field(ge=1)
    """Number of the sketch in its session, counted from 1."""
    drawn_frame: Frame
    """Frame of the state that it was planned for."""
    planned_by: str = Field(max_length=100)
    """Name of the method that planned."""
    sketch: SketchRecord
    """The sketch, or the first of several."""
    keyframes: list[KeyframeRecord] | None = Field(default=None, max_length=MAX_KEYFRAMES)
    """Several sketches in turn; null where there is one."""
    settings: LimitedSettings
    """Their settings."""

    @classmethod
    def of(cls, plan: Led, settings: Mapping[str, Any], *, frame: int, number: int) -> Self:
        """Return the record of a plan that begins to steer at a frame."""
        keyframes = None
        if isinstance(plan, Sequence):
            keyframes = [
                KeyframeRecord.model_validate(
                    {
                        "sketch": SketchRecord.of(one.goal).model_dump(),
                        "frames": one.frames,
                        "hold": one.hold,
                        "who": one.who,
                    }
                )
                for one in plan.keyframes
            ]
        return cls(
            frame=frame,
            number=number,
            drawn_frame=plan.first_frame,
            planned_by=plan.method,
            sketch=SketchRecord.of(plan.sketch),
            keyframes=keyframes,
            settings=LimitedSettings(**settings),
        )

    def goals(self) -> Goals:
        """Return what is to be planned. Raises as `SketchRecord.sketch`."""
        if self.keyframes is None:
            return self.sketch.sketch()
        return [one.keyframe() for one in self.keyframes]


class ReleaseInput(Strict):
    """End of the sketch that steers."""

    kind: Literal["release"] = "release"
    """Kind of the input."""
    frame: Frame
    """First frame whose state no sketch acts on."""


class PushInput(Strict):
    """Start, change or end of a hand's push."""

    kind: Literal["push"] = "push"
    """Kind of the input."""
    frame: Frame
    """First frame whose state it acts on."""
    push: Hand | None
    """Force of the hand; null ends it, and a pull."""

    def force(self) -> Push | None:
        """Return the force from that frame on."""
        return None if self.push is None else self.push.force()


class PullInput(Strict):
    """Start or change of a hand's pull at a rigid body."""

    kind: Literal["pull"] = "pull"
    """Kind of the input."""
    frame: Frame
    """First frame whose state it acts on."""
    pull: Grip
    """Force of the hand."""

    def force(self) -> Pull:
        """Return the force from that frame on."""
        return self.pull.force()


HandInput: TypeAlias = PushInput | PullInput
"""What a hand does from a frame on."""


def hand_input(frame: int, force: Push | Pull | None) -> HandInput:
    """Return the input of a hand's force from a frame on."""
    record = hand_record(force)
    if isinstance(record, Grip):
        return PullInput(frame=frame, pull=record)
    return PushInput(frame=frame, push=record)


Input: TypeAlias = SketchInput | ReleaseInput | PushInput | PullInput
INPUT: TypeAdapter[Input] = TypeAdapter(Annotated[Input, Field(discriminator="kind")])
"""Reader of an input's JSON."""


class Inputs(Several[Input]):
    """Inputs in the order in which they act, kept as JSON; a model is made of one when it is looked at.

    Thousands of models would be hundreds of thousands of objects among which Python searches for circles.
    Each search would keep the event loop waiting.
    """

    def __init__(self, inputs: Iterable[Input] = ()) -> None:
        self._texts: list[str] = []
        self.frames: list[int] = []
        """First frame of each."""
        self.sketches: list[int] = []
        """Places of the sketches among them."""
        for one in inputs:
            self.append(one)

    def append(self, made: Input) -> None:
        """Add an input."""
        if isinstance(made, SketchInput):
            self.sketches.append(len(self))
        self._texts.append(made.model_dump_json())
        self.frames.append(made.frame)

    def copy(self) -> "Inputs":
        """Return a copy."""
        twin = Inputs()
        twin._texts, twin.frames, twin.sketches = self._texts[:], self.frames[:], self.sketches[:]
        return twin

    def text(self) -> bytes:
        """Return all of them as a JSON array."""
        return f"[{','.join(self._texts)}]".encode()

    def sketch(self, place: int) -> SketchInput:
        """Return the sketch at a place of `sketches`."""
        return SketchInput.model_validate_json(self._texts[place])

    def __len__(self) -> int:
        return len(self._texts)

    @overload
    def __getitem__(self, place: int) -> Input: ...

    @overload
    def __getitem__(self, place: slice) -> "Inputs": ...

    def __getitem__(self, place: int | slice) -> "Input | Inputs":
        if isinstance(place, slice):
            return Inputs(INPUT.validate_json(text) for text in self._texts[place])
        return INPUT.validate_json(self._texts[place])

    def __eq__(self, other: object) -> bool:
        return self._texts == other._texts if isinstance(other, Inputs) else NotImplemented

    __hash__ = None  # type: ignore[assignment]


def _plain(record: Sketch | Push | Pull) -> dict[str, Any]:
    """Return the fields of a record without absent ones; arrays are lists, but for those of surfaces."""
    given = {field.name: getattr(record, field.name) for field in fields(record)}
    given = {name: value for name, value in given.items() if value is not None}
    return given if isinstance(record, Solid) else {name: _listed(value) for name, value in given.items()}


def _listed(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_listed(one) for one in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


class Versions(Strict):
    """Versions that computed a session; others need not give the same bits."""

    hybridmpm: str = Field(max_length=100)
    """Version of the library."""
    solver: int
    """Version of the solver."""
    model: str | None = Field(max_length=64)
    """SHA-256 of the network's file; null without a network."""


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Scene and simulator of a session."""

    scene: Scene
    scenario: str | None
    """Scenario of the scene; None where a scene was given."""
    seed: int | None
    """Seed of the scenario; None where a scene was given."""
    choice: SolverChoice
    """The simulator; its network has a name."""
    versions: Versions

    @classmethod
    def of(cls, scene: Scene, chosen: ChosenSolver, scenario: str | None, seed: int | None) -> Self:
        """Return the origin of a session that begins now."""
        choice = SolverChoice(
            solver=chosen.simulator.kind, coarse=chosen.coarse, model=chosen.model, r_c=chosen.r_c
        )
        versions = Versions(hybridmpm=__version__, solver=SOLVER_VERSION, model=chosen.model_sha256)
        return cls(scene=scene, scenario=scenario, seed=seed, choice=choice, versions=versions)

    def record(self) -> dict[str, Any]:
        """Return the origin as plain data; `of_record` makes an equal one of it."""
        return {
            "versions": self.versions.model_dump(),
            "scenario": self.scenario,
            "seed": self.seed,
            "scene": self.scene.model_dump(mode="json", exclude_none=True),
            **vars(self.choice),
        }

    @classmethod
    def of_record(cls, record: Mapping[str, Any], scene: Scene | None = None) -> Self:
        """Return the origin of a record, whose scene may have been read already.

        Raises
        ------
        SceneError, FieldError
            The scene or the choice is refused.
        KeyError, TypeError, ValueError
            The record is malformed.
        """
        return cls(
            scene=scene or Scene.parse(record["scene"]),
            scenario=record["scenario"],
            seed=record["seed"],
            choice=SolverChoice(**{name: record[name] for name in ("solver", "coarse", "model", "r_c")}),
            versions=Versions(**record["versions"]),
        )

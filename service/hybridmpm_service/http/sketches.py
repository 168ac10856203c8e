"""Sketches over HTTP: reading of strokes or a picture, and the answers about goals, needs and motions."""

import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Any, Literal, Self, TypeVar

import numpy as np
import numpy.typing as npt
from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import AfterValidator, ConfigDict, ValidationError
from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException

from hybridmpm import SketchError
from hybridmpm.control import (
    ControlledTrajectory,
    Goal,
    Keyframe,
    Led,
    Leg,
    Needs,
    Oval,
    Sequence,
    Sketch,
    check_in_world,
    parse_png,
    parse_strokes,
)
from hybridmpm_service.errors import FieldError, UnsupportedFormatError, UploadTooLargeError
from hybridmpm_service.http.answers import Answer, example
from hybridmpm_service.http.requests import KeyframeRequest, SketchRequest, read_body
from hybridmpm_service.sessions.inputs import Goals, SketchRecord, SketchSettings
from hybridmpm_service.sessions.turns import Turns
from hybridmpm_service.sessions.view import CellMeans

_PICTURE = "sketch"
"""Form field of the picture."""
_OUTLINE_POINTS = 96
_DIGITS = 4
"""Decimals of needs and of points on outlines."""
_GUIDED: dict[str, Any] = {
    "sketch": {"kind": "arrow", "points": [[0.3, 0.5], [0.6, 0.7]]},
    "method": "analytic",
    "reason": "guidance from the actual state takes the least force and plans at once",
    "frames": 100,
    "hold": 0,
    "first_frame": 12,
    "planning_ms": 14.2,
    "needs": {
        "acceleration": 4.2,
        "peak": 4.2,
        "rms": 2.6,
        "cap": 15.0,
        "frames": 100,
        "suggested_frames": 100,
        "scale": 1.0,
        "taken": 0.0,
        "reachable": True,
        "obstructions": [],
        "notes": [],
        "text": "4.2 g in 100 frames, of 15 g allowed; at ease in 100 frames",
    },
    "goal": {"path": [[0.41, 0.52], [0.71, 0.72]], "drawn": None, "region": None},
}

T = TypeVar("T")
_Rounded = Annotated[float, AfterValidator(lambda value: round(value, _DIGITS))]


async def read_sketch(
    request: Request, turns: Turns, max_upload_bytes: int, size: tuple[float, ...]
) -> tuple[Goals, SketchSettings]:
    """Return the sketch of a request in a world of a size [m], or several, and their settings.

    Raises
    ------
    RequestValidationError, FieldError
        A field is not allowed, or the sketch cannot be read.
    UploadTooLargeError
        The picture has more bytes than the limit.
    UnsupportedFormatError
        The body is neither JSON nor a multipart form.
    """
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type == "application/json":
        return await _read_strokes(turns, await request.body(), size)
    if media_type == "multipart/form-data":
        return await _read_form(request, turns, max_upload_bytes, size)
    raise UnsupportedFormatError(
        "send application/json with strokes or multipart/form-data with a picture, "
        f"got {media_type or 'no Content-Type'}"
    )


async def _read_strokes(turns: Turns, data: bytes, size: tuple[float, ...]) -> tuple[Goals, SketchSettings]:
    content = await read_body(turns, data)

    def parse() -> tuple[Goals, SketchSettings]:
        body = _checked(lambda: SketchRequest.model_validate(content))
        return _goals(body, size), body.settings()

    return await _off_loop(turns, "body", parse)


def _goals(body: SketchRequest, size: tuple[float, ...]) -> Goals:
    """Return what a request describes, in a world of a size [m]."""
    given = [name for name in ("strokes", "sketch", "keyframes") if getattr(body, name) is not None]
    if len(given) != 1:
        found = " and ".join(given) or "none of them"
        raise FieldError("body", f"exactly one of strokes, sketch and keyframes must be given, got {found}")
    if body.keyframes is None:
        return _goal(body, "body", size)
    for name in ("frames", "hold", "who"):
        if getattr(body, name):
            raise FieldError(f"body.{name}", "belongs to each of the keyframes")
    keyframes = []
    for number, one in enumerate(body.keyframes):
        goal = _goal(one, f"body.keyframes[{number}]", size)
        keyframes.append(Keyframe(goal, one.frames, one.hold, one.model_dump()["who"]))
    return keyframes


def _goal(body: SketchRequest | KeyframeRequest, field: str, size: tuple[float, ...]) -> Sketch:
    """Return the one sketch of a part of a request."""
    if (body.strokes is None) == (body.sketch is None):
        raise FieldError(field, "exactly one of strokes and sketch must be given")
    try:
        if body.sketch is None:
            return parse_strokes(body.strokes or [], size)
        sketch = body.sketch.sketch()
        check_in_world(sketch, size)
    except TypeError:
        raise FieldError(f"{field}.sketch", "has a field that its kind does not have, or lacks one") from None
    except SketchError as err:
        if body.sketch is None:
            inner, _, message = str(err).partition(": ")
            raise FieldError(f"{field}.{inner}", message) from err
        raise FieldError(f"{field}.sketch", str(err)) from err
    return sketch


async def _read_form(
    request: Request, turns: Turns, max_bytes: int, size: tuple[float, ...]
) -> tuple[Sketch, SketchSettings]:
    known = [*SketchSettings.model_fields]
    async with _form(request, fields=len(known)) as form:
        upload = form.get(_PICTURE)
        # Browsers send a field that nothing was entered into as an empty one.
        texts = {name: value for name, value in form.items() if name != _PICTURE and value != ""}
        unknown = sorted(set(texts) - set(known))
        if unknown:
            fields = ", ".join([_PICTURE, *known])
            raise FieldError(f"body.{unknown[0]}", f"unknown field; there are {fields}")
        if not isinstance(upload, UploadFile):
            raise FieldError(
                "body.sketch", "is required, as a file: a PNG, JPEG or WebP of a red arrow or a green outline"
            )
        settings = _checked(lambda: SketchSettings.model_validate_strings(texts))
        # The whole form is limited, too, while it arrives.
        data = await upload.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise UploadTooLargeError(f"sketch: the file has more than the allowed {max_bytes} bytes")
    return await _off_loop(turns, "body.sketch", lambda: parse_png(data, size)), settings


@contextlib.asynccontextmanager
async def _form(request: Request, fields: int) -> AsyncIterator[FormData]:
    """Read a form; raises `FieldError` where a part that is no file is too large."""
    try:
        async with request.form(max_files=1, max_fields=fields, max_part_size=1024) as form:
            yield form
    except HTTPException as error:
        if "exceeded maximum size" not in error.detail:
            raise
        text = "has a field of more than 1 KiB: the picture must be sent as a file, with a filename"
        raise FieldError("body", text) from None


def _checked(validate: Callable[[], T]) -> T:
    try:
        return validate()
    except ValidationError as err:
        problems = [problem | {"loc": ("body", *problem["loc"])} for problem in err.errors(include_url=False)]
        raise RequestValidationError(problems) from None


async def _off_loop(turns: Turns, field: str, parse: Callable[[], T]) -> T:
    try:
        return await turns.run(parse)
    except SketchError as err:
        # Messages about strokes begin with the field; a picture has no fields.
        inner, colon, message = str(err).partition(": ")
        if colon and inner.startswith("strokes"):
            raise FieldError(f"{field}.{inner}", message) from err
        raise FieldError(field, str(err)) from err


class ForceBody(Answer):
    """Force of a sketch and a hand in the next frame, where there is any; [cell][axis]."""

    model_config = example(frame=12, cell=0.05, points=[[0.41, 0.52]], force=[[8.1, 16.2]])

    frame: int
    """Number of frames before that frame."""
    cell: float
    """Side of a cell [m]."""
    points: list[list[float]]
    """Mean position of the particles of each cell [m]."""
    force: list[list[float]]
    """Mean acceleration of these particles, without gravity [m/s^2]."""

    @classmethod
    def of(cls, means: CellMeans) -> Self:
        """Describe means of accelerations, rounded to the precision of a picture."""
        points, force = means.points.round(_DIGITS).tolist(), means.values.round(2).tolist()
        return cls(frame=means.frame, cell=means.cell, points=points, force=force)


class ObstructionBody(Answer):
    """A reason why a goal is out of reach."""

    reason: Literal["wall", "obstacle", "shape", "time", "cap"]
    """Kind of the obstruction."""
    message: str
    """Description of the obstruction, with a remedy."""


class NeedsBody(Answer):
    """Requirements of a sketch. Accelerations are in g = 9.81 m/s^2, without gravity."""

    acceleration: _Rounded
    """Largest acceleration that 95 % of the mass needs [g]."""
    peak: _Rounded
    """Largest acceleration that any group of particles needs [g]."""
    rms: _Rounded
    """Root mean square of the least force over mass and time [g]."""
    cap: float
    """Largest allowed acceleration [g]."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    suggested_frames: int
    """Fewest frames in which it is reached with ease."""
    scale: _Rounded
    """Size of the goal over that of the drawn oval: above 1 if it was grown to the fluid's volume, below 1
    if it was shrunk to it, 1 for an arrow."""
    taken: _Rounded
    """Share of the drawn oval that walls and obstacles take."""
    reachable: bool
    """Whether no obstruction is known."""
    obstructions: list[ObstructionBody]
    """Known obstructions; empty if the goal is within reach."""
    notes: list[str]
    """Remarks that keep nothing out of reach, e.g. that the way was bent round an obstacle."""
    text: str
    """Summary in words."""

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """Describe the needs of a sketch."""
        known = {
            name: getattr(needs, name)
            for name in cls.model_fields
            if name not in {"text", "obstructions", "notes"}
        }
        known["notes"] = list(needs.notes)
        obstructions = [{"reason": one.reason, "message": one.message} for one in needs.obstructions]
        return cls.model_validate(known | {"obstructions": obstructions, "text": str(needs)})


class GoalBody(Answer):
    """Goal of a sketch. In 3D an outline is that of the section in its own depth."""

    path: list[list[float]]
    """Planned path of the centre of mass; [point][axis] [m]."""
    drawn: list[list[float]] | None
    """Outline of the oval as it was drawn, within the walls; [point][axis] [m]. Null for an arrow and a
    shape."""
    outlines: list[list[list[float]]] | None = None
    """Outlines of a shape, or of a solid in the front view, at the size to fill, within the walls;
    [line][point][axis] [m]. Null for others."""
    region: list[list[float]] | None
    """Outline of the region to fill, within the walls; [point][axis] [m]. It is the oval, grown or shrunk as
    `needs.scale` says, or a disc around the tip of an arrow. Obstacles take their part of it. Null where an
    arrow keeps the fluid's shape."""

    @classmethod
    def of(cls, goal: Goal) -> Self:
        """Describe a goal."""
        region, outlines = goal.region, None
        if region is not None and not isinstance(region.figure, Oval):
            outlines = _outlines(goal, region.figure.center, region.scale)
        return cls(
            outlines=outlines,
            path=goal.path.round(_DIGITS).tolist(),
            drawn=_outline(goal, goal.drawn, 1.0) if isinstance(goal.drawn, Oval) else None,
            region=_outline(goal, region.figure, region.scale)
            if region is not None and isinstance(region.figure, Oval)
            else None,
        )


class LegBody(Answer):
    """A goal among several."""

    sketch: dict[str, Any]
    """The sketch as interpreted."""
    start: int
    """Frames since the start of the sequence at which it begins."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    hold: int
    """Number of frames for which it is kept."""
    velocity: list[float] | None
    """Velocity of the centre of mass at the goal [m/s]; null for rest."""
    needs: NeedsBody

    @classmethod
    def of(cls, leg: Leg) -> Self:
        """Describe a goal among several."""
        return cls(
            sketch=SketchRecord.of(leg.keyframe.goal).model_dump(mode="json", exclude_none=True),
            start=leg.start,
            frames=leg.arrival - leg.start,
            hold=leg.keyframe.hold,
            velocity=None if leg.velocity is None else leg.velocity.round(_DIGITS).tolist(),
            needs=NeedsBody.of(leg.needs),
        )


class GuidanceBody(Answer):
    """Interpretation of a sketch, its method, needs and goal."""

    model_config = example(**_GUIDED)

    sketch: dict[str, Any]
    """The sketch as interpreted: an "arrow" with `points` [m], an "ellipse" with `center` [m], semi-`axes`
    [m] and `angle` [rad], a "shape" with `outlines` [m], or a "solid" with `vertices` [m] and `triangles`. In
    3D `widths` or `width` [pixels] give the depth of the others."""
    method: str
    """Name of the method that planned."""
    reason: str
    """Reason of this method."""
    frames: int
    """Number of frames in which the goal is to be reached."""
    hold: int
    """Number of frames for which the goal is kept after that."""
    first_frame: int
    """Frame of the session at which the sketch begins to steer."""
    planning_ms: float
    """Time of the planning [ms]."""
    needs: NeedsBody
    goal: GoalBody
    keyframes: list[LegBody] | None = None
    """Several goals in turn, of which the fields above describe the present one, and `frames` and `hold` the
    last; null for one sketch."""

    @classmethod
    def of(cls, guidance: Led, first_frame: int, **more: Any) -> Self:
        """Describe a guidance that steers from `first_frame` on."""
        legs = guidance.legs if isinstance(guidance, Sequence) else None
        return cls(
            sketch=SketchRecord.of(guidance.sketch).model_dump(mode="json", exclude_none=True),
            method=guidance.method,
            reason=guidance.reason,
            frames=guidance.frames,
            hold=guidance.hold,
            first_frame=first_frame,
            planning_ms=round(guidance.planning_ms, 2),
            needs=NeedsBody.of(guidance.present_needs()),
            goal=GoalBody.of(guidance.goal),
            keyframes=None if legs is None else [LegBody.of(leg) for leg in legs],
            **more,
        )


class SketchBody(GuidanceBody):
    """A sketch that steers a session from now on."""

    model_config = example(number=1, drawn_frame=10, **_GUIDED)

    number: int
    """Number of the sketch in its session, counted from 1."""
    drawn_frame: int
    """Frame of the session whose state the sketch was planned for; `first_frame` is later where the session
    went on meanwhile."""


class ReachedBody(Answer):
    """Result at the end of the sketch's frames."""

    inside: float | None
    """Share of the mass in the goal; null where an arrow keeps the fluid's shape."""
    inside_drawn: float | None
    """Share of the mass in the oval as it was drawn; null for an arrow."""
    miss: float
    """Distance of the centre of mass from its target [m]."""
    rms: float
    """Root mean square of the force over mass and time [g]."""
    peak: float
    """Largest force on a particle [g]."""


class TrajectoryBody(GuidanceBody):
    """The motion that a sketch would give to a session, in T frames, those of `hold` included."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    **_GUIDED,
                    "frames": 2,
                    "reached": {"inside": None, "inside_drawn": None, "miss": 0.001, "rms": 2.7, "peak": 5.1},
                    "mean_force": [[8.1, 16.2], [8.1, 16.2]],
                    "target_displacement": [0.3, 0.2],
                    "displacement": [0.29, 0.18],
                    "centroids": [[0.41, 0.52], [0.5, 0.6], [0.7, 0.7]],
                    "frame_indices": [0, 2],
                    "positions": [[[0.4, 0.5]], [[0.7, 0.7]]],
                    "force": [[[8.1, 16.2]]],
                }
            ]
        }
    )

    reached: ReachedBody
    mean_force: list[list[float]]
    """Acceleration that steers, besides gravity, as the mean over the mass of the particles; [frame][axis], T
    rows [m/s^2]."""
    target_displacement: list[float]
    """Target displacement of the centre of mass [m]."""
    displacement: list[float]
    """Displacement of the centre of mass by the motion [m]."""
    centroids: list[list[float]]
    """Centre of mass at the start and after each frame; [frame][axis], T + 1 rows [m]."""
    frame_indices: list[int]
    """Frame of each row of `positions`, counted from `first_frame`; chosen by `stride`."""
    positions: list[list[list[float | None]]]
    """Positions in these frames of the particles that were there at the start; [row][particle][axis] [m].
    Null where a particle has left the scene."""
    force: list[float] | list[list[list[float]]]
    """Acceleration that steers, besides gravity [m/s^2]: [axis] where it is one constant, else
    [row][particle][axis], where row i is that of the frame which begins with row i of `positions`."""


def trajectory_arrays(motion: ControlledTrajectory, stride: int) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays that JSON and npz share, thinned to each `stride`-th frame and the last.

    Row i of a force (F - 1, N, D) is that of the frame which begins with row i of the positions (F, N, D).
    With a stride of 1 it is the whole force, which `Simulator.advance` takes.
    """
    indices = np.unique(np.append(np.arange(0, motion.frames + 1, stride), motion.frames))
    return {
        "positions": motion.positions[indices],
        "frame_indices": indices,
        "force": motion.force if motion.force.ndim == 1 else motion.force[indices[:-1]],
        "centroids": motion.centroids,
        "mean_force": motion.mean_force,
        "target_displacement": motion.target_displacement,
        "displacement": motion.displacement,
    }


def _outlines(goal: Goal, center: npt.NDArray[np.float64], scale: float) -> list[list[list[float]]]:
    """Return the lines of a sketch grown by a factor from its centre, moved to the walls if beyond them."""
    lines = []
    for line in getattr(goal.sketch, "outlines", ()):
        points = np.hstack([line, np.tile(center[2:], (len(line), 1))])
        grown = center + scale * (points - center)
        lines.append(np.clip(grown, goal.room.lower, goal.room.upper).round(_DIGITS).tolist())
    return lines


def _outline(goal: Goal, oval: Oval, scale: float) -> list[list[float]]:
    """Return points on an oval grown by a factor, moved to the walls where it reaches beyond them."""
    angle = np.linspace(0, 2 * np.pi, _OUTLINE_POINTS, endpoint=False)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) * scale * oval.axes[:2]
    points = oval.center + around @ oval.directions[:2]
    outline: list[list[float]] = np.clip(points, goal.room.lower, goal.room.upper).round(_DIGITS).tolist()
    return outline

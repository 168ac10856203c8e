"""JSON of clients: limits of its structure, and pydantic models of bodies and messages.

The text below a field describes it in the OpenAPI document.
"""

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter
from pydantic_core import from_json

from hybridmpm.control import DEFAULT_CAP, MAX_CAP, METHODS, Fill, Stroke
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.player import MAX_SPEED, MIN_SPEED

MAX_VALUES = 1 << 15
"""Largest number of values in one text: items of arrays, and fields of objects.

Objects, errors and answers made of a text grow with this number, not with its bytes. The largest sketch, a
stroke of 4096 points with widths and times, has 20 500.
"""
MAX_LOG_VALUES = 1 << 18
"""Largest number of values in the log of a session: some twenty thousand pushes of a hand.

All but its inputs have to be at most `MAX_VALUES`.
"""
_LOG = re.compile(rb'\s*\{\s*"log"\s*:')


def read_json(text: bytes | str, field: str) -> Any:
    """Return the value of a JSON text.

    Commas and opening brackets bound the number of values. Those within strings are counted too, so a text
    of strings with thousands of commas is refused. The parser refuses a depth of more than 200.

    Parameters
    ----------
    text : bytes or str
        Bytes are UTF-8.
    field : str
        Name of the text in errors: "body" or "message".

    Raises
    ------
    FieldError
        The text is not JSON, has too many values, or is nested too deeply.
    """
    data = text if isinstance(text, bytes) else text.encode(errors="surrogatepass")
    is_log = _LOG.match(data) is not None
    most = MAX_LOG_VALUES if is_log else MAX_VALUES
    values = 1 + sum(map(data.count, (b",", b"[", b"{")))
    if values > most:
        raise FieldError(field, f"has about {values} values, and may have at most {most}")
    try:
        value = from_json(data)
    except ValueError as err:
        raise FieldError(field, f"is not JSON: {err}") from None
    if is_log:
        _check_beside_inputs(value, field)
    return value


def _check_beside_inputs(body: dict[str, Any], field: str) -> None:
    log = body["log"]
    inputs = log.get("inputs") if isinstance(log, dict) else None
    values, waiting = 0, [body]
    while waiting:
        one = waiting.pop()
        values += 1
        if one is not inputs and isinstance(one, dict | list):
            waiting += one.values() if isinstance(one, dict) else one
    if values > MAX_VALUES:
        raise FieldError(field, f"has {values} values beside its inputs, and may have at most {MAX_VALUES}")


MAX_PUSH_SPEED = 100.0
"""Largest speed of a hand along an axis [m/s]."""
FrameCount = Annotated[int, Field(ge=1, strict=True)]
Cap = Annotated[
    float, Field(gt=0, le=MAX_CAP, description="Largest acceleration of a particle [g = 9.81 m/s^2].")
]


def _known_method(name: str) -> str:
    if name != "auto" and name not in METHODS:
        raise ValueError(f"must be auto, {' or '.join((', '.join([*METHODS][:-1]), [*METHODS][-1]))}")
    return name


class Request(BaseModel):
    """Base of bodies: unknown fields, infinite numbers and strings in place of numbers are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=True, use_attribute_docstrings=True)


class AdvanceSession(Request):
    """Number of frames to advance a session by."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"frames": 10}]})

    frames: FrameCount = 1
    """Number of frames to compute, at most the setting max_advance_frames."""


class SketchSettings(Request):
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
    hold: int = Field(default=0, ge=0, strict=True)
    """Number of frames for which the goal is kept after it was reached."""
    fill: Fill = "even"
    """Treatment of an oval larger than the fluid: filled evenly (even), or shrunk to the volume of the fluid
    (shrink)."""
    seed: int = Field(default=0, ge=0, lt=2**32, strict=True)
    """Seed of random numbers of a method."""


class SketchRequest(SketchSettings):
    """A sketch in its vector form, and its settings."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"strokes": [{"points": [[0.3, 0.5], [0.6, 0.7]], "kind": "arrow"}]},
                {
                    "strokes": [
                        {"points": [[0.6, 0.5], [0.5, 0.6], [0.4, 0.5], [0.5, 0.4]], "kind": "ellipse"}
                    ],
                    "frames": 100,
                    "hold": 50,
                    "cap": 10,
                },
            ]
        }
    )

    strokes: list[Stroke] = Field(min_length=1, max_length=1)
    """Strokes of the sketch: exactly one."""

    def settings(self) -> SketchSettings:
        """Return the settings alone."""
        return SketchSettings.model_validate(self.model_dump(exclude={"strokes"}))


class Play(Request):
    """Start the player."""

    type: Literal["play"]


class Pause(Request):
    """Stop the player."""

    type: Literal["pause"]


class Step(Request):
    """Stop the player, then compute some frames."""

    type: Literal["step"]
    frames: FrameCount = 1


class Reset(Request):
    """Return to frame 0; a running player continues from there."""

    type: Literal["reset"]


class Speed(Request):
    """Choose the target speed of the player: simulated seconds per second."""

    type: Literal["speed"]
    value: float = Field(ge=MIN_SPEED, le=MAX_SPEED)


class Hand(Request):
    """A local force, as by a hand that moves through the fluid."""

    point: list[Annotated[float, Field(ge=0, le=1)]] = Field(min_length=2, max_length=3)
    """Centre [m]."""
    velocity: list[Annotated[float, Field(ge=-MAX_PUSH_SPEED, le=MAX_PUSH_SPEED)]] = Field(
        min_length=2, max_length=3
    )
    """Velocity of the hand [m/s]."""
    radius: float = Field(gt=0, le=1)
    """Reach of the force [m]."""
    cap: Cap = DEFAULT_CAP


class PushFluid(Hand):
    """Push the fluid until the next such command or `push_end`."""

    type: Literal["push"]


class EndPush(Request):
    """Let go of the fluid."""

    type: Literal["push_end"]


Command = Play | Pause | Step | Reset | Speed | PushFluid | EndPush
COMMAND: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(discriminator="type")])
"""Reader of the stream's text messages."""

"""JSON of clients: limits of its structure, and pydantic models of bodies and messages.

The text below a field describes it in the OpenAPI document.
"""

import re
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter

from hybridmpm.control import MAX_KEYFRAMES, Stroke
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.inputs import (
    Frame,
    FrameCount,
    Grip,
    Hand,
    HandInput,
    PullInput,
    PushInput,
    SketchRecord,
    SketchSettings,
    Strict,
    WhoField,
)
from hybridmpm_service.sessions.player import MAX_SPEED, MIN_SPEED
from hybridmpm_service.sessions.scene_work import read_log, value_of
from hybridmpm_service.sessions.turns import Turns

MAX_VALUES = 1 << 15
"""Largest number of values in one text: items of arrays, and fields of objects.

Objects, errors and answers made of a text grow with this number, not with its bytes. The largest sketch, a
stroke of 4096 points with widths and times, has 20 500.
"""
MAX_LOG_VALUES = 1 << 18
"""Largest number of values in the log of a session: some twenty thousand pushes of a hand.

All but its inputs have to be at most `MAX_VALUES`.
"""
_QUICK_BYTES = 1 << 14
"""Largest body that is read on the event loop: it takes less than a millisecond."""
_LOG = re.compile(rb'\s*\{\s*"log"\s*:')
_START_BYTES = 256
"""Number of bytes within which a log says that it is one."""


class Values:
    """Count of the values of a JSON text, part by part, without parsing.

    Commas and opening brackets bound the number of values. Those within strings are counted too, so a text
    of strings with thousands of commas is refused.

    Parameters
    ----------
    field : str
        Name of the text in errors: "body" or "message".
    """

    def __init__(self, field: str) -> None:
        self._field, self._count, self._start = field, 1, b""

    @property
    def is_log(self) -> bool:
        """Whether the text is the log of a session."""
        return _LOG.match(self._start) is not None

    def add(self, part: bytes) -> None:
        """Count the values of the next part.

        Raises
        ------
        FieldError
            There are too many.
        """
        if len(self._start) < _START_BYTES:
            self._start += part[:_START_BYTES]
        self._count += sum(map(part.count, (b",", b"[", b"{")))
        if self._count > MAX_VALUES and self._count > (most := MAX_LOG_VALUES if self.is_log else MAX_VALUES):
            raise FieldError(self._field, f"has {self._count} values or more, and may have at most {most}")


def read_json(text: bytes | str, field: str) -> Any:
    """Return the value of a JSON text; the inputs of a log are read one by one, and are `Inputs` already.

    The parser refuses a depth of more than 200.

    Parameters
    ----------
    text : bytes or str
        Bytes are UTF-8.
    field : str
        Name of the text in errors: "body" or "message".

    Raises
    ------
    FieldError
        The text is not JSON, has a key twice in one object, too many values, or is nested too deeply; or an
        input of a log is not valid.
    """
    data = text if isinstance(text, bytes) else text.encode(errors="surrogatepass")
    values = Values(field)
    values.add(data)
    try:
        value = read_log(data) if values.is_log else value_of(data)
    except (ValueError, RecursionError) as err:
        raise FieldError(field, f"is not JSON: {err}") from None
    if values.is_log:
        _check_beside_inputs(value, field)
    return value


async def read_body(turns: Turns, data: bytes) -> Any:
    """Return the value of a body of JSON, as `read_json` does; a large one is read off the event loop."""
    if len(data) <= _QUICK_BYTES:
        return read_json(data, "body")
    is_log = _LOG.match(data) is not None
    try:
        value = await turns.apart(read_log if is_log else value_of, data)
    except (ValueError, RecursionError) as err:
        raise FieldError("body", f"is not JSON: {err}") from None
    if is_log:
        _check_beside_inputs(value, "body")
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


class AdvanceSession(Strict):
    """Number of frames to advance a session by."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"frames": 10}]})

    frames: FrameCount = 1
    """Number of frames to compute, at most the setting max_advance_frames."""


class KeyframeRequest(Strict):
    """A goal among several: a stroke or a sketch as interpreted, its times, and who is led to it."""

    strokes: list[Stroke] | None = Field(default=None, min_length=1, max_length=1)
    """Strokes of the goal: exactly one."""
    sketch: SketchRecord | None = None
    """The goal as interpreted, in place of strokes."""
    frames: int | None = Field(default=None, ge=1, le=10_000)
    """Number of frames from the goal before to this one. Chosen by the needs of the goal if absent."""
    hold: int = Field(default=0, ge=0, le=10_000)
    """Number of frames for which the goal is kept."""
    who: WhoField = None
    """Particles that are led to it, as of a sketch, chosen in the state at the start."""


class SketchRequest(SketchSettings):
    """A sketch and its settings, or several sketches in turn.

    Exactly one of `strokes`, `sketch` and `keyframes` is given. Each keyframe has its own `frames`, `hold`
    and `who`.
    """

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
                {
                    "keyframes": [
                        {
                            "sketch": {
                                "kind": "shape",
                                "outlines": [[[0.3, 0.4], [0.6, 0.4], [0.6, 0.6], [0.3, 0.6]]],
                            },
                            "frames": 120,
                            "hold": 40,
                        },
                        {"strokes": [{"points": [[0.3, 0.5], [0.6, 0.7]], "kind": "arrow"}], "frames": 80},
                    ]
                },
            ]
        }
    )

    strokes: list[Stroke] | None = Field(default=None, min_length=1, max_length=1)
    """Strokes of the sketch: exactly one."""
    sketch: SketchRecord | None = None
    """The sketch as interpreted, in place of strokes; a shape has no other form."""
    keyframes: list[KeyframeRequest] | None = Field(default=None, min_length=1, max_length=MAX_KEYFRAMES)
    """Several sketches in turn."""

    def settings(self) -> SketchSettings:
        """Return the settings alone."""
        return SketchSettings.model_validate(self.model_dump(exclude={"strokes", "sketch", "keyframes"}))


class MakeLink(Strict):
    """A link to a session."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"seconds": 3600}]})

    seconds: int = Field(default=86_400, ge=1, le=2_592_000)
    """Time until it expires [s]."""


class Play(Strict):
    """Start the player."""

    type: Literal["play"]


class Pause(Strict):
    """Stop the player."""

    type: Literal["pause"]


class Step(Strict):
    """Stop the player, then compute some frames."""

    type: Literal["step"]
    frames: FrameCount = 1


class Reset(Strict):
    """Return to frame 0; a running player continues from there."""

    type: Literal["reset"]


class Speed(Strict):
    """Choose the target speed of the player: simulated seconds per second."""

    type: Literal["speed"]
    value: float = Field(ge=MIN_SPEED, le=MAX_SPEED)


class PushFluid(Hand):
    """Push the fluid until the next such command or `push_end`."""

    type: Literal["push"]


class PullBody(Grip):
    """Pull at a rigid body until the next such command, `push` or `push_end`."""

    type: Literal["pull"]


class EndPush(Strict):
    """Let go of the fluid, or of a body."""

    type: Literal["push_end"]


class StartLead(Strict):
    """Compute the frames of the session in this viewer's tab from now on."""

    type: Literal["lead"]


class LedInput(Strict):
    """What the hand does from a frame on that the tab has computed: it pushes, pulls, or lets go."""

    frame: Frame
    push: Hand | None = None
    pull: Grip | None = None

    def input(self) -> HandInput:
        """Return the input."""
        if self.pull is not None:
            return PullInput(frame=self.frame, pull=self.pull)
        return PushInput(frame=self.frame, push=self.push)


class Follow(Strict):
    """Report the frames that the tab has computed, and its inputs."""

    type: Literal["led"]
    upto: Frame
    inputs: list[LedInput] = Field(default_factory=list, max_length=1000)


class EndLead(Strict):
    """Let the session go on alone from the latest frame that was reported."""

    type: Literal["unlead"]
    digest: str | None = Field(default=None, pattern="^[0-9a-f]{64}$")
    pause: bool = False


Command = Play | Pause | Step | Reset | Speed | PushFluid | PullBody | EndPush | StartLead | Follow | EndLead
COMMAND: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(discriminator="type")])
"""Reader of the stream's text messages."""

"""JSON of clients: limits of its structure, and pydantic models of bodies and messages.

The text below a field describes it in the OpenAPI document.
"""

import re
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter
from pydantic_core import from_json

from hybridmpm.control import Stroke
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.inputs import FrameCount, Hand, SketchSettings, Strict
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


class AdvanceSession(Strict):
    """Number of frames to advance a session by."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"frames": 10}]})

    frames: FrameCount = 1
    """Number of frames to compute, at most the setting max_advance_frames."""


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


class EndPush(Strict):
    """Let go of the fluid."""

    type: Literal["push_end"]


Command = Play | Pause | Step | Reset | Speed | PushFluid | EndPush
COMMAND: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(discriminator="type")])
"""Reader of the stream's text messages."""

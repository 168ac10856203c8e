"""Building blocks of the scene models: checked numbers, vectors, and errors with field paths."""

import math
from dataclasses import dataclass
from datetime import date
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails, InitErrorDetails, PydanticCustomError, core_schema

from hybridmpm._support.arguments import no_truth_value, unmasked
from hybridmpm.errors import SceneError


@dataclass(frozen=True)
class Range:
    """Allowed range of a number, for use in `Annotated`. NaN and infinity lie outside of every range."""

    low: float
    high: float
    unit: str = ""
    open_low: bool = False
    open_high: bool = False

    def __str__(self) -> str:
        left, right = "(" if self.open_low else "[", ")" if self.open_high else "]"
        return f"{left}{_brief(self.low)}, {_brief(self.high)}{right}{self.unit and ' ' + self.unit}"

    def check(self, value: float) -> float:
        """Return `value`; where it lies outside, raise ValueError, whose message gives range and value."""
        above = value > self.low if self.open_low else value >= self.low
        below = value < self.high if self.open_high else value <= self.high
        if not (above and below and math.isfinite(value)):
            raise ValueError(f"must be in {self}, got {_brief(value)}")
        return value

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        number = core_schema.no_info_before_validator_function(no_truth_value, handler(source))
        return core_schema.no_info_after_validator_function(self.check, number)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        described = handler(schema)
        described["exclusiveMinimum" if self.open_low else "minimum"] = self.low
        described["exclusiveMaximum" if self.open_high else "maximum"] = self.high
        return described


def _brief(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


Points = npt.NDArray[np.float64]
"""Points or vectors (..., D)."""
LONGEST = 4096
"""Largest length of a world [m]."""
Coordinate = Annotated[float, Range(0, LONGEST, "m")]
Length = Annotated[float, Range(0, LONGEST, "m", open_low=True)]
_Unmasked = BeforeValidator(partial(unmasked, "the vector", error=ValueError))
_Size = Field(min_length=2, max_length=3)
Point = Annotated[tuple[Coordinate, ...], _Size, _Unmasked]
"""Point of the world, D coordinates [m]; a scene checks that they lie in its own."""
Direction = Annotated[tuple[Annotated[float, Range(-1e3, 1e3)], ...], _Size, _Unmasked]
Velocity = Annotated[tuple[Annotated[float, Range(-50, 50, "m/s")], ...], _Size, _Unmasked]
Gravity = Annotated[tuple[Annotated[float, Range(-1000, 1000, "m/s^2")], ...], _Size, _Unmasked]
Seed = Annotated[int, Range(0, 2**53 - 1)]
"""Seed of a random generator, below 2**53: JavaScript's numbers hold integers exactly only up to there."""


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    # pydantic has no public name for the metaclass of its models.
    ModelMetaclass = type(BaseModel)


class _RaisesSceneError(ModelMetaclass):
    """Makes `Model(...)` raise `SceneError`; validation inside another model keeps pydantic's own errors."""

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:  # noqa: N805 - a metaclass
        try:
            return super().__call__(*args, **kwargs)
        except ValidationError as error:
            raise scene_error(error) from None


class Record(BaseModel, metaclass=_RaisesSceneError):
    """Frozen model without unknown keys; a bad key or value raises `SceneError` with its field path."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Fault = tuple[tuple[str | int, ...], str]
"""Location of a fault, as pydantic writes locations, and what is wrong at that location."""


def is_vector(turn: object) -> bool:
    """Whether a turn is given as a vector, as in 3D, and not as a number."""
    return isinstance(turn, list | tuple) or np.ndim(turn) == 1  # type: ignore[arg-type]  # anything may come


def raise_faults(title: str, faults: list[Fault]) -> None:
    """Raise all `faults` at once, each at its own location, from within a validator of the model `title`.

    Raises
    ------
    pydantic.ValidationError
        There is at least one fault. Pydantic puts the location of the model before that of each fault.
    """
    if faults:
        raise ValidationError.from_exception_data(
            title,
            [
                InitErrorDetails(
                    type=PydanticCustomError("scene", "{text}", {"text": text}), loc=where, input=None
                )
                for where, text in faults
            ],
        )


RANGES = {"uniform", "integer", "choice"}
"""Names of ranges, which scene files of data sets have in place of values."""


def scene_error(error: ValidationError) -> SceneError:
    """Translate pydantic's error into a `SceneError` with paths such as `bodies[0].lower[1]`."""
    return SceneError.of(problems_of(error))


def problems_of(error: ValidationError) -> list[tuple[str, str]]:
    """List field path and message of each fault in `error`."""
    faults = error.errors(include_url=False)
    faulty = {fault["loc"][:depth] for fault in faults for depth in range(len(fault["loc"]))}
    return [(_path(fault["loc"]), _message(fault)) for fault in faults if not _is_consequence(fault, faulty)]


def _is_consequence(fault: ErrorDetails, faulty: set[tuple[str | int, ...]]) -> bool:
    """Whether a fault only follows from another: pydantic drops bad items, then counts what is left.

    `faulty` holds the location of everything that has a fault in it.
    """
    if fault["type"] == "too_short":
        return fault["loc"] in faulty
    return fault["type"] == "default_factory_not_called"


def _looks_other(given: object) -> str:
    """Return a value that YAML makes of text, such as false of an unquoted no, with a hint; else nothing."""
    if given is not None and not isinstance(given, bool | int | float | date):
        return ""
    names = {None: "null", True: "true", False: "false"}
    shown = names[given] if given is None or isinstance(given, bool) else str(given)
    return f"{shown}: text that looks so must stand in quotes"


def _message(fault: ErrorDetails) -> str:  # noqa: C901, PLR0911, PLR0912 - one return a kind of fault
    context, given = fault.get("ctx", {}), fault.get("input")
    if isinstance(given, dict) and len(given) == 1 and given.keys() <= RANGES:
        return f"is a range, {given}: data.SceneTemplate.load(file).draw(seed) draws a scene of it"
    match fault["type"]:
        case "string_type" | "literal_error" if "'" in context.get("expected", "'") and _looks_other(given):
            expected = f"one of {context['expected']}" if "expected" in context else "text"
            return f"must be {expected}, got {_looks_other(given)}"
        case "model_attributes_type" if _looks_other(given):
            return f"must be a name or an object with named fields, got {_looks_other(given)}"
        case "extra_forbidden":
            return "unknown field"
        case "missing":
            return "is required"
        case "model_type" if isinstance(given, BaseModel):
            return f"must be a {context['class_name']}, got a {type(given).__name__}"
        case "model_type":
            return f"{context['class_name']} must be an object with named fields"
        case "model_attributes_type" | "dict_type":
            return f"must be an object with named fields, got {given!r}"[:200]
        case "tuple_type":
            return f"must be a list, got {given!r}"[:200]
        case "union_tag_not_found" if isinstance(given, dict) and "file" in given:
            text = "Scene.load reads files of shapes, beside the scene's file"
            return f"must name its {context['discriminator']}: {text}"
        case "union_tag_not_found":
            return f"must name its {context['discriminator']}"
        case "union_tag_invalid":
            expected, name = context["expected_tags"], context["discriminator"]
            tag = given.get(name.strip("'")) if isinstance(given, dict) else None
            return f"{name} must be one of {expected}, got {_looks_other(tag) or repr(context['tag'])}"
        case "invalid_key":
            return "keys must be text: keys such as on and no must stand in quotes"
        case "too_short":
            return f"must have {context['min_length']} or more items, got {context['actual_length']}"
        case "too_long":
            return f"must have {context['max_length']} or fewer items"
    return fault["msg"].removeprefix("Value error, ")


_TAGGED = ("bodies[", "obstacles[", "rigid[", "emitters[", "sinks[")


def _path(location: tuple[str | int, ...]) -> str:
    """Join a location, leaving out the union tags that pydantic inserts after list items and some fields."""
    path = ""
    may_be_tag = False
    for part in location:
        if isinstance(part, int):
            path += f"[{part}]"
            may_be_tag = path.startswith(_TAGGED) and path.count("[") == 1
        elif may_be_tag:
            may_be_tag = False
        else:
            path += f".{part}" if path else part
            may_be_tag = part in {"material", "rotation", "angular_velocity"}
    return path


def unequal_faults(name: str, points: tuple[tuple[float, ...], ...]) -> list[Fault]:
    """List the points of a shape that have not as many numbers as the first one."""
    return [
        ((name, index), f"must have as many numbers as {name}[0], {len(points[0])}, got {len(point)}")
        for index, point in enumerate(points)
        if len(point) != len(points[0])
    ]


def corner_faults(lower: tuple[float, ...], upper: tuple[float, ...]) -> list[Fault]:
    """List the faults of a box: its corners differ in dimension, or it has no extent along an axis."""
    if len(lower) != len(upper):
        return [(("upper",), f"must have as many numbers as lower, {len(lower)}, got {len(upper)}")]
    return [
        (("upper", axis), f"must be above lower[{axis}] = {a:g}, got {b:g}")
        for axis, (a, b) in enumerate(zip(lower, upper, strict=True))
        if not a < b
    ]

"""Outlines of texts, pictures and SVG paths over HTTP."""

import base64
import binascii
from typing import Any, Self

from pydantic import Field

from hybridmpm.control import Shape, shape_of_path, shape_of_picture, shape_of_text
from hybridmpm.errors import ConfigError, SketchError
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.answers import Answer, example
from hybridmpm_service.sessions.inputs import SketchRecord, Strict

_SOURCES = ("text", "picture", "path")


class OutlinesRequest(Strict):
    """A text, a picture or an SVG path, and the place of its outlines.

    Exactly one of `text`, `picture` and `path` is given.
    """

    model_config = example(text="WATER", center=[0.5, 0.5], height=0.2)

    text: str | None = Field(default=None, min_length=1, max_length=100)
    """Words, traced in the font Aileron."""
    picture: str | None = Field(default=None, min_length=1, max_length=1_400_000)
    """A PNG, JPEG or WebP file of at most 1 MiB in base 64, whose dark parts are traced."""
    path: str | None = Field(default=None, min_length=1, max_length=1 << 16)
    """Attribute d of a path in SVG, closed."""
    center: list[float] = Field(min_length=2, max_length=2)
    """Middle of the rectangle around the shape [m]."""
    height: float = Field(gt=0)
    """Height of that rectangle [m]."""
    width: float | None = Field(default=None, ge=2, le=20)
    """Width of the stroke, which gives the depth in 3D [pixels of 512]."""

    def traced(self) -> Shape:
        """Return the shape.

        Raises
        ------
        FieldError
            The number of sources is not one, or there is nothing to trace.
        """
        given = [name for name in _SOURCES if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none of them"
            raise FieldError("body", f"exactly one of {', '.join(_SOURCES)} must be given, got {found}")
        place = self.center, self.height, self.width
        try:
            if self.text is not None:
                return shape_of_text(self.text, *place)
            if self.picture is not None:
                return shape_of_picture(base64.b64decode(self.picture, validate=True), *place)
            return shape_of_path(self.path or "", *place)
        except binascii.Error as error:
            raise FieldError("body.picture", f"is no base 64: {error}") from error
        except (SketchError, ConfigError) as error:
            message = str(error).removeprefix(f"{given[0]}: ").removeprefix(f"{given[0]} ")
            raise FieldError(f"body.{given[0]}", message) from error


class OutlinesBody(Answer):
    """A shape that was traced."""

    model_config = example(
        sketch={"kind": "shape", "outlines": [[[0.3, 0.4], [0.6, 0.4], [0.6, 0.6], [0.3, 0.6]]]}, area=0.06
    )

    sketch: dict[str, Any]
    """The shape, as sketches and keyframes take it."""
    area: float
    """Its area in the front view [m^2]."""

    @classmethod
    def of(cls, shape: Shape) -> Self:
        """Describe a shape."""
        return cls(sketch=SketchRecord.of(shape).model_dump(mode="json", exclude_none=True), area=shape.area)

"""Reading of sketches and their settings: strokes as JSON, or a PNG in a form."""

import asyncio
from collections.abc import Callable
from typing import TypeVar

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.datastructures import UploadFile

from hybridmpm import SketchError
from hybridmpm.control import Sketch, parse_png, parse_strokes
from hybridmpm_service.errors import FieldError, UnsupportedFormatError
from hybridmpm_service.http.json_text import read_json
from hybridmpm_service.http.requests import SketchRequest, SketchSettings
from hybridmpm_service.http.uploads import read_limited

_PICTURE = "sketch"
"""Form field of the PNG."""

T = TypeVar("T")


async def read_sketch(request: Request, max_upload_bytes: int) -> tuple[Sketch, SketchSettings]:
    """Return the sketch of a request, and how it is to be followed.

    Raises
    ------
    RequestValidationError, FieldError
        A field is not allowed, or the sketch cannot be read.
    UploadTooLargeError
        The PNG has more bytes than the limit.
    UnsupportedFormatError
        The body is neither JSON nor a multipart form.
    """
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type == "application/json":
        return await _read_strokes(await request.body())
    if media_type == "multipart/form-data":
        return await _read_form(request, max_upload_bytes)
    raise UnsupportedFormatError(
        "send application/json with strokes or multipart/form-data with a PNG, "
        f"got {media_type or 'no Content-Type'}"
    )


async def _read_strokes(data: bytes) -> tuple[Sketch, SketchSettings]:
    def parse() -> tuple[Sketch, SketchSettings]:
        content = read_json(data, "body")
        body = _checked(lambda: SketchRequest.model_validate(content))
        return parse_strokes(body.strokes), body.settings()

    return await _off_loop("body", parse)


async def _read_form(request: Request, max_bytes: int) -> tuple[Sketch, SketchSettings]:
    known = [*SketchSettings.model_fields]
    async with request.form(max_files=1, max_fields=len(known), max_part_size=1024) as form:
        upload = form.get(_PICTURE)
        texts = {name: value for name, value in form.items() if name != _PICTURE}
        unknown = sorted(set(texts) - set(known))
        if unknown:
            fields = ", ".join([_PICTURE, *known])
            raise FieldError(f"body.{unknown[0]}", f"unknown field; there are {fields}")
        if not isinstance(upload, UploadFile):
            raise FieldError("body.sketch", "is required, as a file: a PNG of a red arrow or a green outline")
        settings = _checked(lambda: SketchSettings.model_validate_strings(texts))
        data = await read_limited(upload, max_bytes)
    return await _off_loop("body.sketch", lambda: parse_png(data)), settings


def _checked(validate: Callable[[], T]) -> T:
    try:
        return validate()
    except ValidationError as err:
        problems = [problem | {"loc": ("body", *problem["loc"])} for problem in err.errors(include_url=False)]
        raise RequestValidationError(problems) from None


async def _off_loop(field: str, parse: Callable[[], T]) -> T:
    try:
        return await asyncio.to_thread(parse)
    except SketchError as err:
        # Messages about strokes begin with the field; a picture has no fields.
        inner, colon, message = str(err).partition(": ")
        if colon and inner.startswith("strokes"):
            raise FieldError(f"{field}.{inner}", message) from err
        raise FieldError(field, str(err)) from err

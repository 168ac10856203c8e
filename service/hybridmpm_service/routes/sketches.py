"""Route by which a sketch steers a session: a PNG or strokes come in, a trajectory goes out."""

import asyncio
import json
from collections.abc import Callable
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.datastructures import UploadFile

from hybridmpm import SketchError
from hybridmpm.control import Sketch, parse_png, parse_strokes
from hybridmpm_service.errors import FieldError, UnsupportedFormatError
from hybridmpm_service.http.replies import NPZ, json_response, npz_response, wants_npz
from hybridmpm_service.http.requests import SteerSession
from hybridmpm_service.http.sketch_answers import (
    TrajectoryBody,
    sketch_body,
    thinned_force,
    trajectory_arrays,
)
from hybridmpm_service.http.uploads import read_limited
from hybridmpm_service.routes.dependencies import Limits, SessionId, Sessions, problems
from hybridmpm_service.settings import Settings

router = APIRouter(prefix="/v1/sessions", tags=["sketches"])

DEFAULT_FRAMES = 100
MAX_TRAJECTORY_NUMBERS = 1 << 24
"""Largest number of coordinates in a trajectory, frames x particles x dimensions.

They take 64 MiB. Planning holds two trajectories, and a force that changes from frame to frame is as large.
"""
_STRIDE = (
    "Distance in frames between two rows of positions; the first frame and the last are always answered."
)
_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"$ref": "#/components/schemas/SteerSession"}},
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["sketch"],
                    "properties": {
                        "sketch": {
                            "type": "string",
                            "format": "binary",
                            "description": "PNG of a red arrow or a green outline on white.",
                        },
                        "frames": {
                            "type": "integer",
                            "minimum": 1,
                            "default": DEFAULT_FRAMES,
                            "description": "Number of frames that the sketch steers.",
                        },
                    },
                }
            },
        },
    }
}


@router.post(
    "/{session_id}/sketches",
    response_model=TrajectoryBody,
    responses={
        200: {"content": {NPZ: {"schema": {"type": "string", "format": "binary"}}}},
        **problems(404, 413, 415, 422, 503),
    },
    openapi_extra=_BODY,
)
async def steer_session(
    session_id: SessionId,
    request: Request,
    sessions: Sessions,
    limits: Limits,
    stride: Annotated[int, Query(ge=1, le=10_000, description=_STRIDE)] = 10,
) -> Response:
    """Plan a motion that follows the sketch, let the session follow it, and return it."""
    session = sessions.get(session_id)
    sketch, frames = await _read(request, limits)
    numbers = session.simulation.particle_count * session.scene.dim
    most = max(1, min(limits.max_sketch_frames, MAX_TRAJECTORY_NUMBERS // numbers))
    if not 1 <= frames <= most:
        raise FieldError("body.frames", f"must be in [1, {most}] for this session, got {frames}")
    plan = await session.steer(sketch, frames)
    arrays = trajectory_arrays(plan, stride)
    if wants_npz(request):
        return await npz_response(arrays | {"force": thinned_force(plan, stride)})
    known = {"sketch": sketch_body(sketch), "frames": frames, "first_frame": plan.first_frame}
    return await json_response(known | arrays)


async def _read(request: Request, limits: Settings) -> tuple[Sketch, int]:
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if media_type == "application/json":
        return await _read_strokes(await request.body())
    if media_type == "multipart/form-data":
        return await _read_form(request, limits)
    raise UnsupportedFormatError(
        "send application/json with strokes or multipart/form-data with a PNG, "
        f"got {media_type or 'no Content-Type'}"
    )


async def _read_strokes(data: bytes) -> tuple[Sketch, int]:
    def parse() -> tuple[Sketch, int]:
        try:
            body = SteerSession.model_validate(json.loads(data))
        except ValidationError as err:
            problems = [
                problem | {"loc": ("body", *problem["loc"])} for problem in err.errors(include_url=False)
            ]
            raise RequestValidationError(problems) from None
        except (ValueError, RecursionError) as err:
            raise FieldError("body", f"is not JSON: {err}") from None
        return parse_strokes(body.strokes), body.frames

    return await _off_loop("body", parse)


async def _read_form(request: Request, limits: Settings) -> tuple[Sketch, int]:
    async with request.form(max_files=1, max_fields=1, max_part_size=1024) as form:
        upload, frames = form.get("sketch"), form.get("frames", str(DEFAULT_FRAMES))
        unknown = sorted(set(form) - {"sketch", "frames"})
        if unknown:
            raise FieldError(f"body.{unknown[0]}", "unknown field; there are sketch and frames")
        if not isinstance(upload, UploadFile):
            raise FieldError("body.sketch", "is required, as a file: a PNG of a red arrow or a green outline")
        if not isinstance(frames, str) or not frames.isascii() or not frames.isdigit():
            raise FieldError(
                "body.frames", f"must be in [1, {limits.max_sketch_frames}], got {str(frames)[:64]!r}"
            )
        data = await read_limited(upload, limits.max_upload_bytes)
    # Longer numbers are out of range anyway, and slow to convert.
    return await _off_loop("body.sketch", lambda: (parse_png(data), int(frames[:9])))


async def _off_loop(field: str, parse: Callable[[], tuple[Sketch, int]]) -> tuple[Sketch, int]:
    try:
        return await asyncio.to_thread(parse)
    except SketchError as err:
        # Messages about strokes begin with the field; a picture has no fields.
        inner, colon, message = str(err).partition(": ")
        if colon and inner.startswith("strokes"):
            raise FieldError(f"{field}.{inner}", message) from err
        raise FieldError(field, str(err)) from err

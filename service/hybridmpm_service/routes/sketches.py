"""Routes of sketches: steering of a session, following on a copy, and the force that steers."""

import asyncio
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from hybridmpm.control import ControlledTrajectory, Led
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.guard import needs
from hybridmpm_service.http.jobs import JobBody
from hybridmpm_service.http.replies import (
    FRAMES,
    NPZ,
    numbers_response,
    preferred,
    prefers_async,
    streamed,
)
from hybridmpm_service.http.sketches import (
    ForceBody,
    GuidanceBody,
    SketchBody,
    TrajectoryBody,
    read_sketch,
    trajectory_arrays,
)
from hybridmpm_service.jobs import Progress, Result
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import Jobs, Limits, SessionId, Sessions, problems
from hybridmpm_service.sessions.inputs import SketchSettings
from hybridmpm_service.sessions.steering import Steered
from hybridmpm_service.sessions.turns import Turns
from hybridmpm_service.sessions.work import Report, traced

router = APIRouter(prefix="/v1/sessions", tags=["sketches"], route_class=SessionRoute)

MAX_TRAJECTORY_NUMBERS = 1 << 24
"""Largest number of coordinates in a trajectory, frames x particles x dimensions.

They take 64 MiB. The forces take as much, and both exist twice while they are put together.
"""
_REF = "#/components/schemas/{model}"
_STRIDE = (
    "Distance in frames between two rows of positions; the first frame and the last are always included."
)
_PICTURE = {
    "type": "string",
    "format": "binary",
    "description": "PNG, JPEG or WebP of a red arrow or a green outline on paper.",
}
_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"$ref": "#/components/schemas/SketchRequest"}},
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["sketch"],
                    "properties": {"sketch": _PICTURE}
                    | SketchSettings.model_json_schema(ref_template=_REF)["properties"],
                }
            },
        },
    }
}


@router.post(
    "/{session_id}/sketches",
    responses=problems(400, 404, 409, 413, 415, 422, 503),
    openapi_extra=_BODY,
)
@needs("steer")
async def steer_session(
    session_id: SessionId, request: Request, sessions: Sessions, limits: Limits
) -> SketchBody:
    """Let a sketch steer the session; the answer comes when it is planned, while the session goes on."""
    session = sessions.get(session_id)
    sketch, settings = await read_sketch(request, sessions.turns, limits.max_upload_bytes, session.scene.size)
    most = limits.max_sketch_frames
    _check_frames(settings, most)
    return _body(await session.steer(sketch, most=most, **settings.model_dump()))


@router.get("/{session_id}/sketches", responses=problems(404))
@needs("view")
async def get_sketch(session_id: SessionId, sessions: Sessions) -> SketchBody | None:
    """Return the sketch that steers the session and its goal; null where none does."""
    steered = sessions.get(session_id).simulation.steered
    return None if steered is None else _body(steered)


def _body(steered: Steered) -> SketchBody:
    return SketchBody.of(
        steered.guidance,
        steered.first_frame,
        number=steered.number,
        drawn_frame=steered.guidance.first_frame,
    )


@router.delete("/{session_id}/sketches", status_code=204, responses=problems(404, 503))
@needs("steer")
async def release_session(session_id: SessionId, sessions: Sessions) -> None:
    """End the sketch that steers the session, and drop one that is being prepared."""
    await sessions.get(session_id).release()


@router.get("/{session_id}/force", responses=problems(404, 503))
@needs("view")
async def get_force(session_id: SessionId, sessions: Sessions) -> ForceBody:
    """Return the force of a sketch and a hand in the next frame, in the mean over cells of a grid."""
    return ForceBody.of(await sessions.get(session_id).force())


@router.post(
    "/{session_id}/trajectories",
    response_model=TrajectoryBody,
    responses={
        200: {
            "content": {
                NPZ: {"schema": {"type": "string", "format": "binary"}},
                FRAMES: {"schema": {"type": "string", "format": "binary"}},
            }
        },
        202: {"model": JobBody, "description": "The job of a request with `Prefer: respond-async`."},
        **problems(400, 404, 413, 415, 422, 503),
    },
    openapi_extra=_BODY,
)
@needs("steer")
async def trace_sketch(
    *,
    session_id: SessionId,
    request: Request,
    sessions: Sessions,
    jobs: Jobs,
    limits: Limits,
    stride: Annotated[int, Query(ge=1, le=10_000, description=_STRIDE)] = 10,
) -> Response:
    """Follow a sketch to its end on a copy of the session, which does not change; return the motion.

    With `Accept: application/x-hybridmpm-frames` frames are sent as they are computed; with `Prefer:
    respond-async` a job computes the motion.
    """
    session = sessions.get(session_id)
    sketch, settings = await read_sketch(request, sessions.turns, limits.max_upload_bytes, session.scene.size)
    numbers = max(1, session.view.particles) * session.scene.dim
    most = max(1, min(limits.max_sketch_frames, MAX_TRAJECTORY_NUMBERS // numbers))
    _check_frames(settings, most)
    chosen = {"most": most, **settings.model_dump()}
    media_type = preferred(request, NPZ, FRAMES)
    if media_type == FRAMES:
        return await streamed(session, sketch, chosen)
    as_npz = media_type == NPZ

    async def motion(report: Report = lambda _done, _total: None) -> Response:
        found = await session.on_copy(
            lambda twin, check: traced(twin, check, sketch, on_frame=report, **chosen)
        )
        return await _answered(sessions.turns, *found, stride, as_npz=as_npz)

    if not prefers_async(request):
        return await motion()

    async def work(progress: Progress, folder: Path) -> Result:
        answer = await motion(progress.update)
        file = folder / f"trajectory.{'npz' if as_npz else 'json'}"
        await asyncio.to_thread(file.write_bytes, answer.body)
        return Result(file=file, media_type=str(answer.media_type))

    job = JobBody.of(jobs.begin("trajectory", session_id, work))
    headers = {"Location": job.links["self"], "Preference-Applied": "respond-async"}
    return Response(job.model_dump_json(), 202, headers, media_type="application/json")


async def _answered(
    turns: Turns,
    guidance: Led,
    motion: ControlledTrajectory,
    stride: int,
    *,
    as_npz: bool,
) -> Response:
    arrays = trajectory_arrays(motion, stride)
    known = GuidanceBody.of(guidance, motion.first_frame).model_dump(mode="json")
    others = {} if as_npz else known | {"reached": vars(motion.reached)}
    return await numbers_response(turns, others | arrays, as_npz=as_npz)


def _check_frames(settings: SketchSettings, most: int) -> None:
    if settings.hold >= most:
        raise FieldError("body.hold", f"must be in [0, {most - 1}] for this session, got {settings.hold}")
    if settings.frames is not None and settings.frames + settings.hold > most:
        text = f"must be in [1, {most - settings.hold}] for this session"
        if settings.hold:
            text += f" with a hold of {settings.hold}"
        raise FieldError("body.frames", f"{text}, got {settings.frames}")

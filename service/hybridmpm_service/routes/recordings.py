"""Routes of recordings: frames of a copy of a session, as a file."""

from pathlib import Path

from fastapi import APIRouter, Response

from hybridmpm import export
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.jobs import JobBody, RecordSession
from hybridmpm_service.jobs.job import Progress, Result
from hybridmpm_service.routes.handling.calls import SessionRoute
from hybridmpm_service.routes.handling.dependencies import Jobs, Limits, SessionId, Sessions, problems
from hybridmpm_service.sessions.sketches.tracing import recorded

router = APIRouter(prefix="/v1/sessions", tags=["jobs"], route_class=SessionRoute)

_MEDIA_TYPES = {"npz": "application/x-npz", "gif": "image/gif", "mp4": "video/mp4", "png": "image/png"}
_STRIP = 4
"""Pictures side by side in a strip."""
MAX_RECORDED_NUMBERS = 1 << 26
"""Largest number of coordinates in a recording, states x particles x dimensions; velocities take as many."""


@router.post("/{session_id}/recordings", status_code=202, responses=problems(404, 413, 415, 422, 503))
async def record_session(
    *,
    session_id: SessionId,
    body: RecordSession,
    sessions: Sessions,
    jobs: Jobs,
    limits: Limits,
    response: Response,
) -> JobBody:
    """Begin a job that computes frames on a copy of the session, which does not change, and writes a file."""
    session = sessions.get(session_id)
    if body.frames > limits.max_advance_frames:
        raise FieldError("body.frames", f"must be in [1, {limits.max_advance_frames}], got {body.frames}")
    states = 1 + -(-body.frames // body.every)
    most = MAX_RECORDED_NUMBERS // max(1, session.view.particles * session.scene.dim)
    if states > most:
        text = f"must be at least {-(-body.frames // max(1, most - 1))} for so many frames, got {body.every}"
        raise FieldError("body.every", text)
    style = export.Style(width=body.width, speed=body.speed, strip=_STRIP)
    name = f"{session_id[:8]}.{body.format}"
    export.check_target(Path(name))

    async def work(progress: Progress, folder: Path) -> Result:
        file = folder / name
        await session.beside(
            lambda twin, check: recorded(
                twin,
                check,
                file,
                style,
                frames=body.frames,
                every=body.every,
                on_part=progress.tell,
            )
        )
        return Result(file=file, media_type=_MEDIA_TYPES[body.format])

    job = JobBody.of(jobs.begin("recording", session_id, work))
    response.headers["Location"] = job.links["self"]
    return job

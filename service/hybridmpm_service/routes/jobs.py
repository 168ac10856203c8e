"""Routes of jobs, and of the recordings and data sets that jobs make."""

from pathlib import Path
from typing import Annotated, get_args

from fastapi import APIRouter, Request, Response
from fastapi import Path as PathParameter
from starlette.responses import FileResponse, StreamingResponse

from hybridmpm import export
from hybridmpm.data import h5py
from hybridmpm_service.errors import FieldError, JobUnfinishedError
from hybridmpm_service.http.guard import needs
from hybridmpm_service.http.jobs import JobBody, JobList, MakeDataSet, RecordSession, events
from hybridmpm_service.jobs import MEDIA_TYPE, Phase, Progress, Result, made
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import (
    Here,
    Jobs,
    Limits,
    OtherNodes,
    SessionId,
    Sessions,
    problems,
)
from hybridmpm_service.sessions.work import recorded

router = APIRouter(prefix="/v1", tags=["jobs"], route_class=SessionRoute)

_JobId = Annotated[str, PathParameter(description="Name of the job, its `id`.")]
_RECORDED = {"npz": "application/x-npz", "gif": "image/gif", "mp4": "video/mp4", "png": "image/png"}
_STRIP = 4
"""Pictures side by side in a strip."""
_EVENT = {
    "type": "object",
    "description": "One event: the phase of the job, and the job as JSON.",
    "properties": {
        "event": {"type": "string", "enum": list(get_args(Phase))},
        "data": {"type": "string", "contentMediaType": "application/json"},
    },
    "required": ["event", "data"],
}
_FILE = {"schema": {"type": "string", "format": "binary"}}


@router.get("/jobs", responses=problems(422))
@needs("view")
async def list_jobs(jobs: Jobs, peers: OtherNodes, request: Request, *, here: Here = False) -> JobList:
    """List the jobs, the oldest first; with other nodes, theirs as well, and with keys, those of the key."""
    others, missing = ([], []) if here else await peers.rows("jobs", JobBody, request)
    own = [JobBody.of(job) for job in jobs.visible()]
    return JobList(jobs=own + others, missing_nodes=missing)


@router.get("/jobs/{job_id}", responses=problems(404, 410))
@needs("view")
async def get_job(job_id: _JobId, jobs: Jobs) -> JobBody:
    """Describe a job."""
    return JobBody.of(jobs.get(job_id))


@router.get(
    "/jobs/{job_id}/events",
    response_class=StreamingResponse,
    responses={200: {"content": {"text/event-stream": {"schema": _EVENT}}}, **problems(404, 410)},
)
@needs("view")
async def follow_job(job_id: _JobId, jobs: Jobs, sessions: Sessions) -> StreamingResponse:
    """Send each change of a job as a server-sent event, until it ends."""
    progress = events(jobs.get(job_id), sessions.draining)
    return StreamingResponse(progress, media_type="text/event-stream", headers={"Cache-Control": "no-store"})


@router.get(
    "/jobs/{job_id}/result",
    response_class=FileResponse,
    responses={
        200: {"content": dict.fromkeys((*_RECORDED.values(), "application/json", MEDIA_TYPE), _FILE)},
        **problems(404, 409, 410, 422, 503),
    },
)
@needs("view")
async def get_result(job_id: _JobId, jobs: Jobs) -> Response:
    """Return the file of a job, or the problem of a failed one."""
    job = jobs.get(job_id)
    if job.error is not None:
        raise job.error
    if job.result is None:
        raise JobUnfinishedError(f"the job still runs, {job.progress.done} parts are done: follow its events")
    return FileResponse(job.result.file, media_type=job.result.media_type, filename=job.result.file.name)


@router.delete("/jobs/{job_id}", status_code=204, responses=problems(404, 410))
@needs("steer")
async def delete_job(job_id: _JobId, jobs: Jobs) -> None:
    """End a job, and delete its file."""
    await jobs.delete(job_id)


@router.post(
    "/sessions/{session_id}/recordings", status_code=202, responses=problems(404, 413, 415, 422, 503)
)
@needs("create")
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
    memory = body.memory(session.scene, session.view.particles)
    style = export.Style(width=body.width, speed=body.speed, strip=_STRIP)
    name = f"{session_id[:8]}.{body.format}"
    export.check_target(Path(name))

    async def work(progress: Progress, folder: Path) -> Result:
        file = folder / name
        await session.on_copy(
            lambda twin, check: recorded(
                twin, check, file, style, frames=body.frames, every=body.every, on_part=progress.update
            ),
            memory=memory,
        )
        return Result(file=file, media_type=_RECORDED[body.format])

    job = JobBody.of(jobs.begin("recording", session_id, work))
    response.headers["Location"] = job.links["self"]
    return job


@router.post("/datasets", status_code=202, responses=problems(413, 415, 422, 503))
@needs("create")
async def make_dataset(
    *, body: MakeDataSet, sessions: Sessions, jobs: Jobs, limits: Limits, response: Response
) -> JobBody:
    """Begin a job that makes a data set: a zip file of HDF5 files and their metadata."""
    h5py()
    turns = sessions.turns
    recipe, seeds, memory = await turns.run(lambda: body.planned(limits))

    async def work(progress: Progress, folder: Path) -> Result:
        return await made(turns, recipe, seeds, progress, folder, memory=memory)

    job = JobBody.of(jobs.begin("dataset", None, work))
    response.headers["Location"] = job.links["self"]
    return job

"""Routes of jobs: what runs, how far it is, what it has made."""

from typing import Annotated, get_args

from fastapi import APIRouter, Path, Response
from starlette.responses import FileResponse, StreamingResponse

from hybridmpm_service.errors import JobUnfinishedError
from hybridmpm_service.http.jobs import PATH, JobBody, JobList, events
from hybridmpm_service.jobs.datasets import MEDIA_TYPE
from hybridmpm_service.jobs.job import Phase
from hybridmpm_service.routes.handling.dependencies import Jobs, Sessions, problems

router = APIRouter(prefix=PATH, tags=["jobs"])


_JobId = Annotated[str, Path(description="Name of the job, its `id`.")]
_MEDIA_TYPES = ("application/x-npz", "application/json", "image/gif", "image/png", "video/mp4", MEDIA_TYPE)
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


@router.get("")
async def list_jobs(jobs: Jobs) -> JobList:
    """List the jobs, the oldest first."""
    return JobList(jobs=[JobBody.of(job) for job in jobs.all()])


@router.get("/{job_id}", responses=problems(404))
async def get_job(job_id: _JobId, jobs: Jobs) -> JobBody:
    """Describe a job."""
    return JobBody.of(jobs.get(job_id))


@router.get(
    "/{job_id}/events",
    response_class=StreamingResponse,
    responses={200: {"content": {"text/event-stream": {"schema": _EVENT}}}, **problems(404)},
)
async def follow_job(job_id: _JobId, jobs: Jobs, sessions: Sessions) -> StreamingResponse:
    """Tell of each change of a job as a server-sent event, until it ends."""
    told = events(jobs.get(job_id), sessions.draining)
    return StreamingResponse(told, media_type="text/event-stream", headers={"Cache-Control": "no-store"})


@router.get(
    "/{job_id}/result",
    response_class=FileResponse,
    responses={
        200: {"content": dict.fromkeys(_MEDIA_TYPES, _FILE)},
        **problems(404, 409, 422, 503),
    },
)
async def get_result(job_id: _JobId, jobs: Jobs) -> Response:
    """Answer what a job has made; the problem where it has failed."""
    job = jobs.get(job_id)
    if job.error is not None:
        raise job.error
    if job.result is None:
        raise JobUnfinishedError(f"the job still runs, {job.progress.done} parts are done: follow its events")
    return FileResponse(job.result.file, media_type=job.result.media_type, filename=job.result.file.name)


@router.delete("/{job_id}", status_code=204, responses=problems(404))
async def delete_job(job_id: _JobId, jobs: Jobs) -> None:
    """End a job, and forget what it has made."""
    await jobs.delete(job_id)

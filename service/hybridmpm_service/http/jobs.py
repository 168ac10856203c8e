"""Bodies of jobs, and their progress as server-sent events."""

import asyncio
from collections.abc import AsyncIterator
from typing import Literal, Self

from pydantic import BaseModel, Field

from hybridmpm_service.http.problems import Problem, problem_of
from hybridmpm_service.http.requests import FrameCount, Request
from hybridmpm_service.jobs.job import Job, Kind, Phase

PATH = "/v1/jobs"
_LOOK_SECONDS = 0.1
"""Time between two looks at how far a job is."""
_SILENT_SECONDS = 15.0
"""Longest time without an event; proxies close connections that say nothing."""


class RecordSession(Request):
    """What is to be recorded."""

    frames: FrameCount = Field(
        description="Number of frames to compute, at most the setting max_advance_frames.", examples=[200]
    )
    every: FrameCount = Field(default=1, description="Number of frames from one recorded state to the next.")
    format: Literal["npz", "gif", "mp4", "png"] = Field(
        default="npz",
        description="File to write: arrays (npz), a film (gif; mp4 where the server has an encoder), or four "
        "pictures side by side (png).",
    )
    width: int = Field(
        default=480,
        ge=64,
        le=1280,
        strict=True,
        description="Width of a picture of a film or strip [pixels].",
    )
    speed: float = Field(default=1.0, ge=0.01, le=10, description="Simulated seconds in a second of film.")


class JobBody(BaseModel):
    """A job as clients see it."""

    id: str = Field(description="Name of the job.")
    kind: Kind = Field(description="What it makes.")
    session: str | None = Field(
        description="Session that it belongs to; it ends with it. Null for a data set, which has none."
    )
    phase: Phase = Field(description="How far it is: running, done or failed.")
    done: int = Field(description="Number of frames, or other parts, that are done.")
    total: int | None = Field(description="Number of all of them; null until it is known.")
    problem: Problem | None = Field(description="Why it failed; null unless it did.")
    links: dict[str, str] = Field(description="Addresses of the job, its events and its result.")

    @classmethod
    def of(cls, job: Job) -> Self:
        """Describe a job."""
        own = f"{PATH}/{job.id}"
        return cls(
            id=job.id,
            kind=job.kind,
            session=job.session,
            phase=job.phase,
            done=job.progress.done,
            total=job.progress.total,
            problem=None if job.error is None else problem_of(own, job.error),
            links={"self": own, "events": f"{own}/events", "result": f"{own}/result"},
        )


class JobList(BaseModel):
    """The jobs of the service."""

    jobs: list[JobBody] = Field(description="All jobs that run or whose results are kept, the oldest first.")


async def events(job: Job, draining: asyncio.Event) -> AsyncIterator[bytes]:
    """Yield a job's body as a server-sent event whenever it has changed, the last one at its end.

    A server that stops, for which `draining` is set, ends it as well.
    """
    before, silent = "", 0.0
    while True:
        phase = job.phase
        text = JobBody.of(job).model_dump_json()
        if text != before:
            before, silent = text, 0.0
            yield f"event: {phase}\ndata: {text}\n\n".encode()
        elif silent >= _SILENT_SECONDS:
            silent = 0.0
            yield b": still there\n\n"
        if phase != "running" or draining.is_set():
            return
        await asyncio.sleep(_LOOK_SECONDS)
        silent += _LOOK_SECONDS

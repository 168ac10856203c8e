"""Bodies of jobs, recordings and data sets, and progress as server-sent events."""

import asyncio
from collections.abc import AsyncIterator
from functools import lru_cache
from typing import Literal, Self
from weakref import WeakKeyDictionary

from pydantic import ConfigDict, Field

from hybridmpm import Scene
from hybridmpm.data import Recipe, Seeds
from hybridmpm.errors import ConfigError, UnknownScenarioError
from hybridmpm.scenarios import NAMES
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.answers import Answer
from hybridmpm_service.http.problems import Problem, problem_of
from hybridmpm_service.jobs import Job, Kind, Phase
from hybridmpm_service.keys.callers import CALLER
from hybridmpm_service.sessions.inputs import FrameCount, Strict
from hybridmpm_service.settings import Settings

_LOOK_SECONDS = 0.1
"""Time between two looks at the progress of a job."""
_SILENT_SECONDS = 15.0
"""Longest time without an event; proxies close silent connections."""
_SECONDS_PER_LISTENER = 0.0025
"""Time between two looks for each listener of a job: a thousand listeners cost no more than forty."""
MAX_RECORDED_NUMBERS = 1 << 26
"""Largest number of coordinates in a recording, states x particles x dimensions; velocities take as many."""
_listeners: WeakKeyDictionary[Job, int] = WeakKeyDictionary()
MOST_TRAJECTORIES = 1000
MOST_FILM_SECONDS = 60.0
"""Longest film [s]."""
BYTES_PER_PIXEL = 800
"""Memory that the drawing of a picture takes for each of its pixels [bytes]."""
MOST_NUMBERS = 1 << 27
"""Largest number of coordinates in a data set, all states of all trajectories together: 512 MiB."""


class RecordSession(Strict):
    """Settings of a recording."""

    frames: FrameCount = Field(examples=[200])
    """Number of frames to compute, at most the setting max_advance_frames."""
    every: FrameCount = 1
    """Number of frames from one recorded state to the next."""
    format: Literal["npz", "gif", "mp4", "png"] = "npz"
    """File to write: arrays (npz), a film (gif; mp4 where the server has an encoder), or four pictures side
    by side (png)."""
    width: int = Field(default=480, ge=64, le=1280, strict=True)
    """Width of a picture of a film or strip [pixels]."""
    speed: float = Field(default=1.0, ge=0.01, le=10)
    """Simulated seconds in a second of film, which may last a minute."""

    def memory(self, scene: Scene, particles: int) -> int:
        """Return an estimate of the memory that it takes [bytes].

        Raises
        ------
        FieldError
            The recording or the film would be larger than this server makes.
        """
        states, numbers = 1 + -(-self.frames // self.every), max(1, particles * scene.dim)
        most = MAX_RECORDED_NUMBERS // numbers
        if states > most:
            text = f"must be at least {-(-self.frames // max(1, most - 1))} for so many frames"
            raise FieldError("body.every", f"{text}, got {self.every}")
        slowest = self.frames * scene.frame_dt / MOST_FILM_SECONDS
        if self.format in {"gif", "mp4"} and self.speed < slowest:
            raise FieldError(
                "body.speed", f"must be at least {slowest:.2g} for so many frames, got {self.speed:g}"
            )
        # Positions and velocities, and what a file of them takes while it is made.
        drawing = 0 if self.format == "npz" else BYTES_PER_PIXEL * self.width**2
        return 16 * states * numbers + drawing


class MakeDataSet(Strict):
    """A data set of trajectories of a scenario; a trajectory depends on these settings and its seed alone."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"scenario": "water_2d", "trajectories": 2, "frames": 100}]}
    )

    scenario: str = Field(max_length=100, description=f"Scenario of the scenes: one of {', '.join(NAMES)}.")
    trajectories: int = Field(ge=0, le=MOST_TRAJECTORIES, strict=True)
    """Number of trajectories for training."""
    valid: int = Field(default=0, ge=0, le=MOST_TRAJECTORIES, strict=True)
    """Number of trajectories for validation."""
    test: int = Field(default=0, ge=0, le=MOST_TRAJECTORIES, strict=True)
    """Number of trajectories for tests."""
    seed: int = Field(default=0, ge=0, lt=2**31, strict=True)
    """First seed of each split, counted from the start of the split's seeds."""
    frames: FrameCount | None = None
    """Number of frames of a trajectory; that of the scenario if absent. All trajectories together have at
    most the setting max_dataset_frames."""
    stride: FrameCount = 1
    """Number of frames from one stored state to the next."""
    r_p: float = Field(default=1.0, gt=0, le=1)
    """Ratio of the particles to those of the scene."""

    def planned(self, limits: Settings) -> tuple[Recipe, Seeds, int]:
        """Return the recipe, the seeds, and an estimate of the memory of a trajectory [bytes].

        Raises
        ------
        FieldError
            A setting is out of range, or the data set is larger than this server makes.
        """
        try:
            seeds = Seeds(train=self.trajectories, valid=self.valid, test=self.test, first=self.seed)
            recipe = Recipe(scenario=self.scenario, frames=self.frames, stride=self.stride, r_p=self.r_p)
            scene = recipe.scene(self.seed)
        except UnknownScenarioError as err:
            raise FieldError("body.scenario", str(err).removeprefix("scenario: ")) from None
        except ConfigError as err:
            raise FieldError("body", str(err)) from None
        count = sum(seeds.counts().values())
        frames, most = count * (recipe.states - 1) * recipe.stride, limits.max_dataset_frames
        if frames > most:
            text = f"makes {frames} frames in all, and this server makes at most {most} (max_dataset_frames)"
            raise FieldError("body.trajectories", text)
        numbers = round(count * recipe.states * scene.dim * len(scene.sample().x) * self.r_p)
        if numbers > MOST_NUMBERS:
            text = f"must be at least {-(-self.stride * numbers // MOST_NUMBERS)} for so many frames"
            raise FieldError("body.stride", f"{text}, got {self.stride}")
        # A trajectory, its file and a copy of that while it is written.
        return recipe, seeds, 12 * numbers // max(1, count)


class JobBody(Answer):
    """State of a job."""

    id: str
    """Name of the job."""
    kind: Kind
    """Kind of its result."""
    key: str | None = None
    """Name of the key that the job belongs to; null without keys."""
    session: str | None
    """Session of the job, which ends with it. Null for a data set."""
    phase: Phase
    """running, done or failed."""
    done: int
    """Number of frames, or other parts, that are done."""
    total: int | None
    """Number of all parts; null until it is known."""
    problem: Problem | None
    """Reason of a failure; null without one."""
    links: dict[str, str]
    """Addresses of the job, its events and its result."""

    @classmethod
    def of(cls, job: Job) -> Self:
        """Describe a job."""
        own = f"/v1/jobs/{job.id}"
        return cls(
            id=job.id,
            kind=job.kind,
            key=job.owner or None,
            session=job.session,
            phase=job.phase,
            done=job.progress.done,
            total=job.progress.total,
            problem=None if job.error is None else problem_of(own, job.error),
            links={"self": own, "events": f"{own}/events", "result": f"{own}/result"},
        )


class JobList(Answer):
    """The jobs of the service, or of all nodes."""

    jobs: list[JobBody]
    """Running jobs and those whose results are kept, the oldest first; those of this node come first."""
    missing_nodes: list[str] = Field(default_factory=list)
    """Names of the nodes that did not answer, so that theirs are missing."""


async def events(job: Job, draining: asyncio.Event) -> AsyncIterator[bytes]:
    """Yield a job's body as a server-sent event after each change, the last one at its end.

    A stopping server, for which `draining` is set, ends it as well, as the end of the listener's key does.
    """
    before, silent, caller = b"", 0.0, CALLER.get()
    _listeners[job] = _listeners.get(job, 0) + 1
    try:
        while True:
            phase = job.phase
            event = _event(job, phase, job.progress.done, job.progress.total)
            if event != before:
                before, silent = event, 0.0
                yield event
            elif silent >= _SILENT_SECONDS:
                silent = 0.0
                yield b": still there\n\n"
            if phase != "running" or draining.is_set() or not caller.is_valid():
                return
            pause = max(_LOOK_SECONDS, _SECONDS_PER_LISTENER * _listeners[job])
            await asyncio.sleep(pause)
            silent += pause
    finally:
        _listeners[job] -= 1


@lru_cache(maxsize=32)
def _event(job: Job, phase: Phase, *_progress: int | None) -> bytes:
    """Return the event of a job in a state, made once for all its listeners."""
    return f"event: {phase}\ndata: {JobBody.of(job).model_dump_json()}\n\n".encode()

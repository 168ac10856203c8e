"""Logs of sessions as JSON, in answers and in bodies."""

from collections.abc import Callable
from typing import Annotated, Any, Literal, Self
from weakref import WeakKeyDictionary

from pydantic import (
    ConfigDict,
    FailFast,
    Field,
    GetPydanticSchema,
    WrapValidator,
    model_validator,
)

from hybridmpm import Scene
from hybridmpm.simulator import Kind
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.inputs import (
    Frame,
    Input,
    Inputs,
    Origin,
    Strict,
    Versions,
)
from hybridmpm_service.sessions.journal import MAX_INPUTS
from hybridmpm_service.sessions.revival import SessionLog
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.turns import Turns

FORMAT = 1
"""Version of the form of a log."""
_starts: WeakKeyDictionary[Session, bytes] = WeakKeyDictionary()
"""Starts of the logs of sessions, which do not change; a scene may have thousands of bodies."""


def _taken(value: Any, read: Callable[[Any], list[Input]]) -> Inputs:
    """Return the inputs of a log, which may be `Inputs` already."""
    if not isinstance(value, Inputs):
        return Inputs(read(value))
    if len(value) > MAX_INPUTS:
        raise ValueError(f"has {len(value)} inputs, and may have at most {MAX_INPUTS}")
    return value


_LIST = Annotated[
    list[Annotated[Input, Field(discriminator="kind")]],
    # Only the first wrong input is reported: thousands of errors would take long to make.
    FailFast(),
    Field(max_length=MAX_INPUTS),
    WrapValidator(_taken),
]


class LogBody(Strict):
    """Log of a session, to compute it again from, with the digest of the result.

    Sent as `log` of a new session, to this server or another one, it makes a session in the same state: with
    the same bits where versions are the same.
    """

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "format": FORMAT,
                    "versions": {"hybridmpm": "0.1.0", "solver": 4, "model": None},
                    "scenario": "water_2d",
                    "seed": 7,
                    "scene": {
                        "dim": 2,
                        "bodies": [
                            {"shape": "box", "lower": [0.3, 0.4], "upper": [0.5, 0.6], "material": "water"}
                        ],
                    },
                    "solver": "mpm",
                    "coarse": None,
                    "model": None,
                    "r_c": None,
                    "frame": 60,
                    "inputs": [
                        {
                            "kind": "push",
                            "frame": 20,
                            "push": {"point": [0.4, 0.2], "velocity": [1, 0], "radius": 0.1, "cap": 15},
                        },
                        {"kind": "push", "frame": 31, "push": None},
                    ],
                    "digest": "0" * 64,
                }
            ]
        }
    )

    format: Literal[1]
    """Version of the form of the log."""
    versions: Versions
    """Versions that computed the session."""
    scenario: str | None = Field(max_length=100)
    """Scenario that the scene was drawn from; null where a scene was sent."""
    seed: int | None = Field(ge=0, lt=2**53, strict=True)
    """Seed of the scenario."""
    scene: dict[str, Any]
    """Scene, as `hybridmpm schema` describes it."""
    solver: Kind
    """Simulator."""
    coarse: str | None = Field(max_length=100)
    """Coarse level; null where none was chosen."""
    model: str | None = Field(max_length=100)
    """Name of the network; null without one."""
    r_c: float | None = Field(ge=-1, le=1)
    """Value below which the safeguard alarms."""
    frame: Frame
    """Frame at which the log ends."""
    inputs: Annotated[Inputs, GetPydanticSchema(lambda _, handler: handler.generate_schema(_LIST))]
    """Inputs of the session, in order; frames ascend."""
    digest: str = Field(pattern="^[0-9a-f]{64}$")
    """SHA-256 of the state in which the log ends: ids (uint64), positions and velocities (float32),
    little-endian, one after the other, as `particles` answers them."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        frames = self.inputs.frames
        if frames != sorted(frames):
            raise ValueError("the frames of the inputs must ascend")
        if frames and frames[-1] > self.frame:
            raise ValueError(f"an input acts in frame {frames[-1]}, after the end of the log at {self.frame}")
        for one in map(self.inputs.sketch, self.inputs.sketches):
            if one.drawn_frame > one.frame:
                raise ValueError(
                    f"sketch {one.number} was planned in frame {one.drawn_frame}, after it began to steer"
                )
        return self

    def log(self, scene: Scene, most_frames: int) -> SessionLog:
        """Return the log.

        Parameters
        ----------
        scene : Scene
            What `scene` contains; the inputs fit it, as `scene_work.read_logged` checks.
        most_frames : int
            Largest frame at which it may end.

        Raises
        ------
        FieldError
            Something is out of range.
        """
        if self.frame > most_frames:
            raise FieldError("body.log.frame", f"must be at most {most_frames}, got {self.frame}")
        origin = Origin.of_record(vars(self) | {"versions": self.versions.model_dump()}, scene)
        return SessionLog(origin=origin, frame=self.frame, inputs=self.inputs, digest=self.digest)


async def text_of(session: Session, turns: Turns) -> bytes:
    """Return the log of a session as JSON; errors as `Session.log`.

    Whatever is long is written once, however often the log is downloaded: the start, and the inputs.
    """
    log = await session.log()
    start = _starts.get(session)
    if start is None:
        start = _starts[session] = await turns.run(lambda: _start_of(log))
    rest = (log.frame, log.inputs.text(), log.digest.encode())
    return b'%b"frame":%d,"inputs":%b,"digest":"%b"}' % (start, *rest)


def _start_of(log: SessionLog) -> bytes:
    """Return the JSON of a log before its frame."""
    ends = {"frame": 0, "inputs": [], "digest": log.digest}
    body = LogBody.model_validate({"format": FORMAT, **log.origin.record(), **ends})
    return body.model_dump_json(exclude={"inputs"}).encode().rpartition(b'"frame":')[0]

"""Logs of sessions as JSON, in answers and in bodies."""

from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, FailFast, Field, model_validator

from hybridmpm.control import MAX_POINTS
from hybridmpm.simulator import Kind
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.requests import Hand, Request, SketchSettings
from hybridmpm_service.sessions.inputs import Input, Origin, Versions, input_of
from hybridmpm_service.sessions.journal import MAX_INPUTS
from hybridmpm_service.sessions.revival import SessionLog

FORMAT = 1
"""Version of the form of a log."""
Frame = Annotated[int, Field(ge=0, strict=True)]


class LoggedSketch(Request):
    """A sketch as interpreted: an arrow has points and widths, an ellipse the rest."""

    kind: Literal["arrow", "ellipse"]
    """Kind of the sketch."""
    points: list[list[float]] | None = Field(default=None, max_length=MAX_POINTS)
    """Points of an arrow from tail to tip [m]."""
    widths: list[float] | None = Field(default=None, max_length=MAX_POINTS)
    """Width of an arrow's stroke at each point [pixels of 512]."""
    center: list[float] | None = None
    """Centre of an ellipse [m]."""
    axes: list[float] | None = None
    """Semi-axes of an ellipse, major first [m]."""
    angle: float | None = None
    """Angle of the major axis to +x [rad]."""
    width: float | None = None
    """Width of an ellipse's stroke [pixels of 512]."""


class LoggedSettings(SketchSettings):
    """Settings of a sketch."""

    most: int = Field(ge=1, strict=True)
    """Largest number of frames, above that of `hold`."""


class LoggedSteering(Request):
    """A sketch that begins to steer; it replaces an older one."""

    kind: Literal["sketch"]
    """Kind of the input."""
    frame: Frame
    """First frame whose state it acts on."""
    number: int = Field(ge=1, strict=True)
    """Number of the sketch in its session."""
    drawn_frame: Frame
    """Frame of the state that it was planned for."""
    planned_by: str = Field(max_length=100)
    """Name of the method that planned."""
    sketch: LoggedSketch
    """The sketch."""
    settings: LoggedSettings
    """Its settings."""


class LoggedRelease(Request):
    """End of the sketch that steers."""

    kind: Literal["release"]
    """Kind of the input."""
    frame: Frame
    """First frame whose state no sketch acts on."""


class LoggedPush(Request):
    """Start, change or end of a hand's push."""

    kind: Literal["push"]
    """Kind of the input."""
    frame: Frame
    """First frame whose state it acts on."""
    push: Hand | None
    """Force of the hand; null ends it."""


LoggedInput = Annotated[LoggedSteering | LoggedRelease | LoggedPush, Field(discriminator="kind")]


class LogBody(Request):
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
    # Only the first wrong input is reported: thousands of errors would take long to make.
    inputs: Annotated[list[LoggedInput], FailFast()] = Field(max_length=MAX_INPUTS)
    """Inputs of the session, in order; frames ascend."""
    digest: str = Field(pattern="^[0-9a-f]{64}$")
    """SHA-256 of the state in which the log ends: ids (uint64), positions and velocities (float32),
    little-endian, one after the other, as `particles` answers them."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        frames = [one.frame for one in self.inputs]
        if frames != sorted(frames):
            raise ValueError("the frames of the inputs must ascend")
        if frames and frames[-1] > self.frame:
            raise ValueError(f"an input acts in frame {frames[-1]}, after the end of the log at {self.frame}")
        for one in self.inputs:
            if isinstance(one, LoggedSteering) and one.drawn_frame > one.frame:
                raise ValueError(
                    f"sketch {one.number} was planned in frame {one.drawn_frame}, after it began to steer"
                )
        return self

    @classmethod
    def of(cls, log: SessionLog) -> Self:
        """Return the body of a log."""
        return cls.model_validate(
            {
                "format": FORMAT,
                **log.origin.record(),
                "frame": log.frame,
                "inputs": [one.record() for one in log.inputs],
                "digest": log.digest,
            }
        )

    def log(self, most_frames: int, most_sketch_frames: int) -> SessionLog:
        """Return the log.

        Parameters
        ----------
        most_frames : int
            Largest frame at which it may end.
        most_sketch_frames : int
            Largest number of frames that a sketch may steer.

        Raises
        ------
        SceneError, FieldError, SketchError
            Something is out of range.
        """
        if self.frame > most_frames:
            raise FieldError("body.log.frame", f"must be at most {most_frames}, got {self.frame}")
        origin = Origin.of_record(vars(self) | {"versions": self.versions.model_dump()})
        inputs = tuple(
            _input(one, f"body.log.inputs[{place}]", origin.scene.dim, most_sketch_frames)
            for place, one in enumerate(self.inputs)
        )
        return SessionLog(origin=origin, frame=self.frame, inputs=inputs, digest=self.digest)


def _input(
    one: LoggedSteering | LoggedRelease | LoggedPush, field: str, dim: int, most_sketch_frames: int
) -> Input:
    record = one.model_dump()
    if isinstance(one, LoggedSteering):
        settings = one.settings
        longest = max(settings.most, (settings.frames or 1) + settings.hold)
        if longest > most_sketch_frames:
            raise FieldError(
                f"{field}.settings", f"steers for up to {longest} frames, at most {most_sketch_frames} may be"
            )
        record["sketch"] = {name: value for name, value in record["sketch"].items() if value is not None}
    if isinstance(one, LoggedPush) and one.push is not None:
        for name in ("point", "velocity"):
            given = len(getattr(one.push, name))
            if given != dim:
                raise FieldError(f"{field}.push.{name}", f"must have {dim} numbers, got {given}")
    try:
        return input_of(record)
    except TypeError:
        raise FieldError(
            f"{field}.sketch", "an arrow has points, an ellipse center, axes and angle"
        ) from None

"""What the service answers about a scene before its first frame, as JSON."""

from collections.abc import Iterable
from typing import Self

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from hybridmpm.checking import Finding, SceneCheck, Severity
from hybridmpm.errors import SceneError

MOST_FINDINGS = 20
"""Largest number of findings in an answer, the gravest first."""
_THIN: JsonDict = {
    "severity": "warning",
    "field": "obstacles[0]",
    "problem": "is 0.01 m thick, less than 2 cells of 0.00781 m, so fast material may pass through it",
    "advice": "make it at least 0.0156 m thick, or raise the resolution",
}


class FindingBody(BaseModel):
    """One thing that a check says of a scene."""

    model_config = ConfigDict(json_schema_extra={"examples": [_THIN]})

    severity: Severity = Field(
        description="error: the scene does not run, or not stably. warning: it runs, and the result is not "
        "what one may expect. note: it costs more than it has to."
    )
    field: str = Field(description='Part of the scene that it is about, as a path; "" for the whole.')
    problem: str = Field(description="What is wrong, with its figures.")
    advice: str = Field(description='What to change; "" where the problem already says it.')

    @classmethod
    def first_of(cls, findings: Iterable[Finding]) -> list[Self]:
        """Describe the first `MOST_FINDINGS` findings."""
        return [cls.model_validate(vars(one)) for one in list(findings)[:MOST_FINDINGS]]


class CheckBody(BaseModel):
    """What is known of a scene before its first frame. What could not be found out is null."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "scene": "water_2d",
                    "ok": True,
                    "particles": 3210,
                    "stable": True,
                    "bound": "sound",
                    "substeps": 12,
                    "milliseconds": 0.9,
                    "memory": 64_000_000,
                    "findings": [_THIN],
                }
            ]
        }
    )

    scene: str = Field(description="Title of the scene.")
    ok: bool = Field(description="Whether there is no error among the findings.")
    particles: int | None = Field(description="Number of particles that are shown at frame 0.")
    stable: bool | None = Field(
        description="Whether MPM's substeps are below the stability limit; null also where a network moves "
        "the particles, for which no bound is known."
    )
    bound: str | None = Field(
        description='What chose the shortest substep: "sound", "speed", "obstacle", "frame", "reference" or '
        '"fixed"; null also where a network made the frames.'
    )
    substeps: int | None = Field(description="Substeps of the first frames; null as with `bound`.")
    milliseconds: float | None = Field(
        description="Time of a frame [ms], as measured on this server in the first frames."
    )
    memory: int | None = Field(description="Memory that the simulation takes, estimated [bytes].")
    findings: list[FindingBody] = Field(
        description=f"What may go wrong and what is dear: the gravest {MOST_FINDINGS} findings."
    )

    @classmethod
    def of(cls, check: SceneCheck) -> Self:
        """Describe a check."""
        figures = {name: value for name, value in vars(check).items() if name != "findings"}
        return cls(**figures, ok=check.ok, findings=FindingBody.first_of(check.findings))

    @classmethod
    def refused(cls, error: SceneError) -> Self:
        """Describe a scene that is none, or that this server does not take."""
        problems = error.problems or [("", str(error))]
        found = [Finding(severity="error", field=field, problem=text, advice="") for field, text in problems]
        nothing = dict.fromkeys(("particles", "stable", "bound", "substeps", "milliseconds", "memory"))
        return cls(**nothing, scene="", ok=False, findings=FindingBody.first_of(found))

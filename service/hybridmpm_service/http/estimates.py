"""Bodies of checks and plans: estimates of a scene before its first frame."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from hybridmpm.checking import Finding, SceneCheck, Severity
from hybridmpm.errors import SceneError
from hybridmpm.planner import Plan
from hybridmpm.planner.planning import Prospect
from hybridmpm_service.http.requests import Request

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


Measure = Literal["grid_rmse", "grid_nrmse", "grid_node_error", "transport", "kinetic_energy", "centroid"]


class PlanRequest(Request):
    """A scene, and the error or the time that its simulation has to keep within."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"scenario": "water_2d", "seed": 7, "budget_ms": 0.2},
                {"scenario": "sand_3d", "max_error": 0.5, "measure": "grid_rmse"},
            ]
        }
    )

    scenario: str | None = Field(
        default=None, max_length=100, description="Scenario that the scene is drawn from."
    )
    seed: int | None = Field(
        default=None, ge=0, lt=2**53, strict=True, description="Seed of the scenario; 0 if absent."
    )
    scene: dict[str, Any] | None = Field(
        default=None, description="Scene of your own, in the place of a scenario."
    )
    max_error: float | None = Field(
        default=None, gt=0, description="Largest mean error: the quickest coarse level within it is answered."
    )
    budget_ms: float | None = Field(
        default=None,
        gt=0,
        description="Longest time of a frame [ms]: the most accurate coarse level within it is answered.",
    )
    measure: Measure = Field(default="grid_rmse", description="Measure of the error.")

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        if (self.scenario is None) == (self.scene is None):
            raise ValueError('give one of "scenario" (with "seed") and "scene"')
        if self.scene is not None and self.seed is not None:
            raise ValueError('"seed" belongs to a scenario; the bodies of a scene have their own')
        if (self.max_error is None) == (self.budget_ms is None):
            raise ValueError('give one of "max_error" and "budget_ms"')
        return self


class ProspectBody(BaseModel):
    """What is expected of a level in the scene."""

    name: str = Field(description="Name of the level.", examples=["coarse 1/16"])
    error: float = Field(description="Mean error by the measure.", examples=[0.44])
    error_se: float | None = Field(description="Its standard error over the scenes of the calibration.")
    ms_per_frame: float = Field(
        description="Median time of a frame in mid-splash on one thread of the server [ms].", examples=[0.09]
    )


class PlanBody(ProspectBody):
    """The coarse level that was chosen."""

    measure: Measure = Field(description="Measure of the error.")
    feasible: bool = Field(description="Whether it meets the demand; else it is the nearest level.")
    r_p: float = Field(description="Share of the particles that are simulated.")
    particles: int = Field(description="About how many particles are simulated.")
    resolution: int = Field(description="Cells per metre of their grid.")
    substeps: int = Field(description="About how many substeps a frame has in mid-splash.")
    show_all: bool = Field(description="Whether all particles are carried along with fewer.")
    session: dict[str, Any] | None = Field(
        description="Fields of `POST /v1/sessions` that choose this coarse level; null where no session can have it.",
        examples=[{"solver": "mpm", "coarse": "1/16"}],
    )
    candidates: list[ProspectBody] = Field(description="All that were compared, the quickest first.")
    runner_up: ProspectBody | None = Field(description="The next that would have been chosen.")
    reason: str = Field(description="Why this coarse level; what an impossible demand would take.")
    notes: list[str] = Field(description="What the figures rest on.")

    @classmethod
    def of(cls, plan: Plan, candidates: Sequence[Prospect]) -> Self:
        """Describe a plan, and what it was chosen among."""
        ascending = sorted(candidates, key=lambda one: one.ms_per_frame)
        plain = {**plan.to_dict(), "candidates": [asdict(one) for one in ascending]}
        known = {name: plain[name] for name in cls.model_fields if name in plain}
        return cls.model_validate(known | {"session": _session(plan)})


def _session(plan: Plan) -> dict[str, Any] | None:
    """Return the fields of a session at the plan's coarse level; None where sessions have no such settings."""
    if plan.model is not None:
        shows_all = plan.show_all and set(plan.settings) <= {"show_all"}
        return {"solver": plan.simulator, "model": plan.model} if shows_all else None
    if plan.candidate.softer == 1 and set(plan.settings) <= {"coarse"}:
        return {"solver": "mpm", **plan.settings}
    return None

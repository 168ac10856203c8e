"""Answers of checks and plans: estimates of a scene before its first frame."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Self

from pydantic import Field

from hybridmpm.checking import Finding, SceneCheck
from hybridmpm.errors import SceneError
from hybridmpm.planner import Plan, Prospect
from hybridmpm_service.http.answers import FINDING, MOST_FINDINGS, Answer, FindingBody, example
from hybridmpm_service.http.creation import Measure


class CheckBody(Answer):
    """Estimates and findings of a scene before its first frame. Unknown figures are null."""

    model_config = example(
        scene="water_2d",
        ok=True,
        particles=3210,
        stable=True,
        bound="sound",
        substeps=12,
        milliseconds=0.9,
        memory=64_000_000,
        findings=[FINDING],
    )

    scene: str
    """Title of the scene."""
    ok: bool
    """Whether there is no error among the findings."""
    particles: int | None
    """Number of particles that are shown at frame 0."""
    stable: bool | None
    """Whether MPM's substeps are below the stability limit; null also where a network moves the particles,
    for which no bound is known."""
    bound: str | None
    """Bound that chose the shortest substep: "sound", "speed", "obstacle", "frame", "reference" or "fixed";
    null also where a network made the frames."""
    substeps: int | None
    """Substeps of the first frames; null as with `bound`."""
    milliseconds: float | None
    """Time of a frame [ms], measured on this server in the first frames."""
    memory: int | None
    """Estimated memory of the simulation [bytes]."""
    findings: list[FindingBody] = Field(
        description=f"Faults, risks and costs of the scene: the gravest {MOST_FINDINGS} findings."
    )

    @classmethod
    def of(cls, check: SceneCheck) -> Self:
        """Describe a check."""
        figures = {name: value for name, value in vars(check).items() if name != "findings"}
        return cls(**figures, ok=check.ok, findings=FindingBody.first_of(check.findings))

    @classmethod
    def refused(cls, error: SceneError) -> Self:
        """Describe a scene that is not valid, or beyond a limit of this server."""
        problems = error.problems or [("", str(error))]
        found = [Finding(severity="error", field=field, problem=text, advice="") for field, text in problems]
        nothing = dict.fromkeys(("particles", "stable", "bound", "substeps", "milliseconds", "memory"))
        return cls(**nothing, scene="", ok=False, findings=FindingBody.first_of(found))


class ProspectBody(Answer):
    """Expected error and time of a method in the scene."""

    name: str = Field(examples=["coarse 1/16"])
    """Name of the method."""
    error: float = Field(examples=[0.44])
    """Mean error by the measure."""
    error_se: float | None
    """Its standard error over the scenes of the calibration."""
    ms_per_frame: float = Field(examples=[0.09])
    """Median time of a frame in mid-splash on one thread of the server [ms]."""


class PlanBody(ProspectBody):
    """The chosen method."""

    measure: Measure
    """Measure of the error."""
    feasible: bool
    """Whether it meets the limit; otherwise it is the nearest method."""
    r_p: float
    """Ratio of the simulated particles to those of the scene."""
    particles: int
    """Estimated number of simulated particles."""
    resolution: int
    """Cells per metre of their grid."""
    substeps: int
    """Estimated number of substeps of a frame in mid-splash."""
    show_all: bool
    """Whether all particles of the scene are shown where fewer are simulated."""
    session: dict[str, Any] | None = Field(examples=[{"solver": "mpm", "coarse": "1/16"}])
    """Fields of `POST /v1/sessions` that choose this method; null where no session can have it."""
    candidates: list[ProspectBody]
    """All compared methods, the fastest first."""
    runner_up: ProspectBody | None
    """The second choice."""
    reason: str
    """Reason of the choice; for an infeasible limit, the requirements of a feasible one."""
    notes: list[str]
    """Sources of the figures."""

    @classmethod
    def of(cls, plan: Plan, candidates: Sequence[Prospect]) -> Self:
        """Describe a plan and the methods that it was chosen from."""
        ascending = sorted(candidates, key=lambda one: one.ms_per_frame)
        plain = {**plan.to_dict(), "candidates": [asdict(one) for one in ascending]}
        known = {name: plain[name] for name in cls.model_fields if name in plain}
        return cls.model_validate(known | {"session": _session(plan)})


def _session(plan: Plan) -> dict[str, Any] | None:
    """Return the fields of a session with the plan's method; None where sessions have no such settings."""
    if plan.model is not None:
        shows_all = plan.show_all and set(plan.settings) <= {"show_all"}
        return {"solver": plan.simulator, "model": plan.model} if shows_all else None
    if plan.candidate.softer == 1 and set(plan.settings) <= {"coarse"}:
        return {"solver": "mpm", **plan.settings}
    return None

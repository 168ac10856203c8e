"""Answers about sessions, scenarios and networks: pydantic models with examples.

The text below a field describes it in the OpenAPI document.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict

from hybridmpm.checking import Finding, SceneCheck, Severity
from hybridmpm.decisions import Decision, Mode
from hybridmpm.errors import SceneError
from hybridmpm.physics import Entry
from hybridmpm.planner import Estimate, Plan
from hybridmpm.scenarios import ScenarioInfo
from hybridmpm.simulator import Kind
from hybridmpm_service.http.creation import Measure
from hybridmpm_service.sessions.journal import Kept
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.view import CellMeans, Control, LastFrame, View, finite

LATEST_DECISIONS = 16
"""Number of decisions in a status message; `DecisionList` has all of them."""
MOST_FINDINGS = 20
"""Largest number of findings in an answer, the gravest first."""
_ID = "6f0c5b0e4c7d4be59f0d0f5c3c1a2b34"
_LINKED = ("stream", "advance", "particles", "fork", "log", "sketches", "trajectories", "decisions")


class Answer(BaseModel):
    """Base of answers."""

    model_config = ConfigDict(use_attribute_docstrings=True)


def example(**fields: Any) -> ConfigDict:
    """Return the configuration of an answer with an example."""
    return ConfigDict(json_schema_extra={"examples": [fields]})


_FINDING: JsonDict = {
    "severity": "warning",
    "field": "obstacles[0]",
    "problem": "is 0.003 m thick, less than 0.5 cells of 0.00781 m, so fast material may pass through it",
    "advice": "make it at least 0.00391 m thick, or raise the resolution",
}


class FindingBody(Answer):
    """One finding of a scene's check."""

    model_config = example(**_FINDING)

    severity: Severity
    """error: the scene does not run, or not stably. warning: it runs, but the result may not be the expected
    one. note: it costs more than necessary."""
    field: str
    """Path of the part of the scene; "" for the whole."""
    problem: str
    """Description of the fault, with its figures."""
    advice: str
    """Remedy; "" where the problem already names it."""

    @classmethod
    def first_of(cls, findings: Iterable[Finding]) -> list[Self]:
        """Describe the first `MOST_FINDINGS` findings."""
        return [cls.model_validate(vars(one)) for one in list(findings)[:MOST_FINDINGS]]


class SafeguardBody(Answer):
    """The safeguard of a hybrid session at present.

    It measures the mean cosine between the accelerations of the particles in two successive windows of time,
    over the particles that are not calm.
    """

    r_c: float | None
    """Value below which the safeguard alarms, so that MPM takes over; null where other guards alone do."""
    value: float | None
    """Mean cosine in [-1, 1]; null until both windows are full."""
    mpm_share: float
    """Share of the frames so far that MPM simulated, in [0, 1]."""


class SessionBody(Answer):
    """State of a session: its scene, its simulator and its progress."""

    model_config = example(
        id=_ID,
        scenario="water_2d",
        seed=0,
        dim=2,
        particles=3210,
        frame=12,
        time=0.03,
        frame_dt=0.0025,
        playing=False,
        led=False,
        speed=0.25,
        centroid=[0.41, 0.52],
        solver="hybrid",
        coarse=None,
        model="fluids_2d",
        r_p=0.25,
        mode="mpm",
        safeguard={"r_c": 0.8, "value": 0.62, "mpm_share": 0.75},
        control=Control(
            number=1, kind="arrow", phase="steering", method="analytic", first_frame=10, frames_done=2, hold=0
        ).model_dump(),
        kept="disk",
        notice=None,
        findings=[],
        last_frame={"substeps": 12, "bound": "sound", "ms": 1.4},
        links={"self": f"/v1/sessions/{_ID}"} | {name: f"/v1/sessions/{_ID}/{name}" for name in _LINKED},
    )

    id: str
    """Name of the session in its address."""
    key: str | None = None
    """Name of the key that the session belongs to; null without keys."""
    scenario: str | None
    """Scenario of the scene; null where a scene was sent."""
    seed: int | None
    """Seed of the scenario; null where a scene was sent."""
    dim: Literal[2, 3]
    """Dimension D of the scene."""
    particles: int
    """Number N of particles; it changes where the scene has emitters or sinks."""
    frame: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    frame_dt: float
    """Simulated time of a frame [s]."""
    playing: bool
    """Whether the player computes frames."""
    led: bool
    """Whether the tab of a viewer computes the frames first, and the player those that it has reported."""
    speed: float
    """Target speed of the player: simulated seconds per second."""
    centroid: list[float] | None
    """Centre of mass, D numbers [m]; null where there is no particle."""
    solver: Kind
    """Simulator of the session."""
    coarse: str | None
    """Coarse level: the ratio of simulated to shown particles, as "1/16"; null where all are simulated."""
    model: str | None
    """Name of the network; null where MPM simulates alone."""
    r_p: float
    """Ratio of the simulated particles to those of the scene, in (0, 1]."""
    mode: Mode
    """Simulator of the next frame: MPM or the network."""
    safeguard: SafeguardBody | None
    """Safeguard of the network; null unless the session is hybrid."""
    control: Control | None
    """The newest sketch; null where there was none since frame 0."""
    last_frame: LastFrame | None
    """Report on the latest frame; null before the first."""
    kept: Kept
    """Storage of the session: in memory alone (memory), also on disk, so that it survives a crash (disk), or
    in memory because the disk cannot be written at present (failing)."""
    notice: str | None
    """Remark on a session that was computed again; null where there is none."""
    findings: list[FindingBody] = Field(
        description=f"Static findings of the scene's check: at most {MOST_FINDINGS} warnings and notes, the "
        "gravest first. Scenes with errors are refused."
    )
    links: dict[str, str] = Field(
        description=f"Addresses of the session and its parts: self, {', '.join(_LINKED)}."
    )

    @classmethod
    def of(cls, session: Session, view: View | None = None) -> Self:
        """Describe a session by a view, its newest one if absent."""
        view, origin = view or session.view, session.origin
        link = f"/v1/sessions/{session.id}"
        return cls(
            id=session.id,
            scenario=origin.scenario,
            seed=origin.seed,
            dim=session.scene.dim,
            particles=view.particles,
            frame=view.frame,
            time=view.time,
            frame_dt=session.scene.frame_dt,
            key=session.owner or None,
            playing=session.playing,
            led=session.led,
            speed=session.speed,
            centroid=None if view.centroid is None else list(view.centroid),
            solver=origin.choice.solver,
            coarse=origin.choice.coarse,
            model=origin.choice.model,
            r_p=session.simulation.r_p,
            mode=view.mode,
            safeguard=None
            if view.safeguard is None
            else SafeguardBody(**_known(SafeguardBody, view.safeguard)),
            control=session.control,
            kept=session.kept,
            notice=session.notice,
            findings=FindingBody.first_of(session.findings),
            last_frame=view.last_frame,
            links={"self": link} | {name: f"{link}/{name}" for name in _LINKED},
        )


class SessionList(Answer):
    """All sessions of the server, or of all nodes."""

    sessions: list[SessionBody]
    """Sessions, oldest first; those of this node come first."""
    missing_nodes: list[str] = Field(default_factory=list)
    """Names of the nodes that did not answer, so that theirs are missing."""


class DecisionBody(Answer):
    """A decision between MPM and the network."""

    model_config = example(frame=72, mode="mpm", value=3.4, reason="wall", noticed=72)

    frame: int
    """Frame whose end is the first state that `mode` goes on from."""
    mode: Mode
    """Simulator from there on: MPM or the network."""
    value: float | None
    """Value of the guard that decided, or of the safeguard where no guard did; null where there is none."""
    reason: str
    """Name of the guard that decided; where no guard did, "warm-up", "calm", "free_fall", "rest", "force" or
    "unsound"."""
    noticed: int
    """Frame of the decision; later than `frame` where frames of the network were undone."""

    @classmethod
    def of(cls, decision: Decision) -> Self:
        """Describe a decision."""
        return cls(**_known(cls, decision) | {"value": finite(decision.value)})


class DecisionList(Answer):
    """All decisions of a session since frame 0."""

    decisions: list[DecisionBody]
    """Decisions in the order in which they were made."""

    @classmethod
    def of(cls, session: Session) -> Self:
        """Describe the decisions of a session; a session that is not hybrid has none."""
        safeguard = session.view.safeguard
        return cls(decisions=[] if safeguard is None else list(map(DecisionBody.of, safeguard.decisions)))


class HistoryBody(Answer):
    """History of the last 1000 frames of a hybrid session."""

    frames: list[int]
    """Frames at which `values` were taken, ascending."""
    values: list[float]
    """Values of the safeguard at these frames."""
    phases: list[tuple[int, Mode]]
    """First frame and simulator of each phase."""
    decisions: list[DecisionBody]
    """The latest 16 decisions, oldest first."""

    @classmethod
    def of(cls, session: Session) -> Self | None:
        """Describe the history of a session; None unless it is hybrid."""
        safeguard = session.view.safeguard
        if safeguard is None:
            return None
        return cls(
            frames=list(safeguard.frames),
            values=list(safeguard.values),
            phases=safeguard.phases(session.view.frame),
            decisions=list(map(DecisionBody.of, safeguard.decisions[-LATEST_DECISIONS:])),
        )


class ModelBody(Answer):
    """A network that may simulate sessions."""

    model_config = example(
        name="fluids_2d",
        scenarios=["water_2d"],
        r_p=0.25,
        r_t=8,
        latent=64,
        layers=4,
        radius=0.03,
        parameters=151_000,
        solver_versions=[1],
        sha256="e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
    )

    name: str
    """Name of the network."""
    scenarios: list[str]
    """Scenarios that the network serves."""
    r_p: float
    """Ratio of its particles to those of the scene, in (0, 1]."""
    r_t: int
    """Number of frames of one of its steps."""
    latent: int
    """Size of its latent vectors."""
    layers: int
    """Number of its message passing layers."""
    radius: float
    """Distance within which particles are neighbours [m]."""
    parameters: int
    """Number of its parameters."""
    solver_versions: list[int]
    """Versions of the solvers that made its training data."""
    sha256: str
    """SHA-256 digest of its file."""

    @classmethod
    def of(cls, name: str, entry: Entry) -> Self:
        """Describe a model of the manifest."""
        known = {field: getattr(entry, field) for field in cls.model_fields if field != "name"}
        lists = {"scenarios": list(entry.scenarios), "solver_versions": list(entry.solver_versions)}
        return cls(**known | lists | {"name": name})


class ModelList(Answer):
    """All networks of the server."""

    models: list[ModelBody]
    """Networks; the first that serves a scenario is the scenario's default."""


class LinkBody(Answer):
    """A link to a session."""

    model_config = example(token="hmpl_...", until=1_800_000_000, page=f"/?watch={_ID}#link=hmpl_...")  # noqa: S106

    token: str
    """Token to send in place of a key; it shows this session alone."""
    until: int
    """Time from which it is not valid any more [s since 1970]."""
    page: str
    """Address of the page that shows the session; browsers send nothing behind the #."""


class ScenarioBody(Answer):
    """A scenario: a kind of scene, drawn from a seed."""

    model_config = example(
        name="water_2d", dim=2, frames=1000, max_particles=4000, text="1-3 blocks of water"
    )

    name: str
    """Name of the scenario."""
    dim: Literal[2, 3]
    """Dimension of its scenes."""
    frames: int
    """Suggested number of frames of a simulation."""
    max_particles: int
    """Largest number of particles of its scenes."""
    text: str
    """Contents of its scenes."""

    @classmethod
    def of(cls, info: ScenarioInfo) -> Self:
        """Describe a scenario."""
        return cls(**_known(cls, info))


class ScenarioList(Answer):
    """All scenarios of the library."""

    scenarios: list[ScenarioBody]
    """Scenarios."""


class PressureBody(Answer):
    """Pressure in the occupied cells of a grid."""

    model_config = example(frame=12, cell=0.016, points=[[0.41, 0.11]], pressure=[1270.0])

    frame: int
    """Number of frames since the start."""
    cell: float
    """Side of a cell [m]."""
    points: list[list[float]]
    """Mean position of the particles of each cell [m]."""
    pressure: list[float]
    """Mean pressure of these particles [Pa]."""

    @classmethod
    def of(cls, means: CellMeans) -> Self:
        """Describe means of pressures, rounded to the precision of a picture."""
        points, pressure = means.points.round(4).tolist(), means.values[:, 0].round(1).tolist()
        return cls(frame=means.frame, cell=means.cell, points=points, pressure=pressure)


class ParticlesBody(Answer):
    """State of all particles of a session at one instant."""

    model_config = example(
        frame=12, time=0.03, positions=[[0.4, 0.5]], velocities=[[0.0, -0.3]], types=[5], ids=[0], rigid=[]
    )

    frame: int
    """Number of frames since the start."""
    time: float
    """Simulated time since the start [s]."""
    positions: list[list[float]]
    """Positions; [particle][axis] [m]."""
    velocities: list[list[float]]
    """Velocities; [particle][axis] [m/s]."""
    types: list[int]
    """Type of each particle: 3 kinematic, 5 water, 6 sand, 7 elastic (goop), 8 viscous liquid."""
    ids: list[int]
    """Permanent number of each particle, ascending; new particles have larger ones."""
    rigid: list[list[float]]
    """Centre of mass [m], unit quaternion of the turn with the scalar first, velocity [m/s] and angular
    velocity [rad/s] of each rigid body: 3, 4, 3 and 3 numbers, also in 2D."""


def _known(body: type[Answer], record: object) -> dict[str, Any]:
    """Return the attributes of a record that an answer has as fields."""
    return {name: getattr(record, name) for name in body.model_fields}


class ShapeBody(Answer):
    """A shape as fields of a body or an obstacle of a scene."""

    model_config = example(shape="polygon", vertices=[[0.4, 0.4], [0.6, 0.4], [0.5, 0.6]], triangles=None)

    shape: Literal["polygon", "mesh"]
    """Kind of the shape: a polygon in 2D, a mesh in 3D."""
    vertices: list[list[float]] | str
    """Corners [m]; more than 1000 of a mesh are a text, base 64 of float64, little-endian, three a corner."""
    triangles: list[list[int]] | str | None = None
    """Indices of three vertices each, of a mesh; more than 1000 are a text as well, of uint32."""


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
        findings=[_FINDING],
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


class EstimateBody(Answer):
    """Expected error and time of a method in the scene."""

    name: str = Field(examples=["coarse 1/16"])
    """Name of the method."""
    error: float = Field(examples=[0.44])
    """Mean error by the measure."""
    error_se: float | None
    """Its standard error over the scenes of the calibration."""
    error_bound: float | None = Field(examples=[0.58])
    """Error that nine of ten such scenes stay below; `max_error` is compared with it."""
    ms_per_frame: float = Field(examples=[0.09])
    """Median time of a frame in mid-splash on one thread of the server [ms]."""


class PlanBody(EstimateBody):
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
    candidates: list[EstimateBody]
    """All compared methods, the fastest first."""
    runner_up: EstimateBody | None
    """The second choice."""
    reason: str
    """Reason of the choice; for an infeasible limit, the requirements of a feasible one."""
    notes: list[str]
    """Sources of the figures."""

    @classmethod
    def of(cls, plan: Plan, candidates: Sequence[Estimate]) -> Self:
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

"""Answers about sessions, scenarios and networks: pydantic models with examples."""

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from hybridmpm.hybrid import Decision
from hybridmpm.physics.manifest import Entry
from hybridmpm.scenarios import ScenarioInfo
from hybridmpm_service.http.estimates import MOST_FINDINGS, FindingBody
from hybridmpm_service.sessions.journal import Kept
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.solvers import Kind, Mode, SafeguardKind
from hybridmpm_service.sessions.view import CellMeans, Phase, Safeguard, finite

LATEST_DECISIONS = 16
"""Number of decisions in a status message; `DecisionList` has all of them."""


class SafeguardBody(BaseModel):
    """The safeguard of a hybrid session at present.

    It measures the mean cosine between the accelerations of the particles in two successive windows of time.
    """

    kind: SafeguardKind = Field(
        description="Particles that the mean is taken over: those that are not calm (ours), or all (paper)."
    )
    r_c: float | None = Field(
        description="Value below which the safeguard alarms, so that MPM takes over; null where other guards "
        "alone do."
    )
    value: float | None = Field(description="Mean cosine in [-1, 1]; null until both windows are full.")
    mpm_share: float = Field(description="Share of the frames so far that MPM simulated, in [0, 1].")

    @classmethod
    def of(cls, safeguard: Safeguard) -> Self:
        """Describe the safeguard of a session."""
        return cls(
            kind=safeguard.kind,
            r_c=safeguard.r_c,
            value=safeguard.value,
            mpm_share=finite(safeguard.mpm_share) or 0.0,
        )


class DecisionBody(BaseModel):
    """A decision about who simulates from some frame on."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"frame": 72, "mode": "mpm", "value": 3.4, "reason": "impact", "noticed": 72}]
        }
    )

    frame: int = Field(description="Frame whose end is the first state that `mode` goes on from.")
    mode: Mode = Field(description="Who simulates from there on: MPM or the network.")
    value: float | None = Field(
        description="Value of the guard that decided, or of the safeguard where no guard did; null where "
        "there is none yet."
    )
    reason: str = Field(
        description="Name of the guard that decided; where no guard did, "
        '"warm-up", "calm", "free_fall", "rest", "force" or "unsound".'
    )
    noticed: int = Field(
        description="Frame at which the decision was made; later than `frame` where frames of the network "
        "were undone."
    )

    @classmethod
    def of(cls, decision: Decision) -> Self:
        """Describe a decision."""
        return cls(
            frame=decision.frame,
            mode=decision.mode,
            value=finite(decision.value),
            reason=decision.reason,
            noticed=decision.noticed,
        )


class DecisionList(BaseModel):
    """All decisions of a session since frame 0."""

    decisions: list[DecisionBody] = Field(description="Decisions in the order in which they were made.")

    @classmethod
    def of(cls, session: Session) -> Self:
        """Describe the decisions of a session; a session that is not hybrid has none."""
        safeguard = session.view.safeguard
        log = () if safeguard is None else safeguard.decisions
        return cls(decisions=[DecisionBody.of(decision) for decision in log])


class HistoryBody(BaseModel):
    """History of the last 1000 frames of a hybrid session."""

    frames: list[int] = Field(description="Frames at which `values` were taken, ascending.")
    values: list[float] = Field(description="Values of the safeguard at these frames.")
    phases: list[tuple[int, Mode]] = Field(description="First frame of each phase, and who simulated it.")
    decisions: list[DecisionBody] = Field(description="The latest 16 decisions, oldest first.")

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
            decisions=[DecisionBody.of(decision) for decision in safeguard.decisions[-LATEST_DECISIONS:]],
        )


class ModelBody(BaseModel):
    """A network that may simulate sessions."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "name": "fluids_2d",
                    "scenarios": ["water_2d"],
                    "r_p": 0.25,
                    "r_t": 8,
                    "latent": 64,
                    "layers": 4,
                    "radius": 0.03,
                    "parameters": 151_000,
                    "solver_versions": [1],
                    "sha256": "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
                }
            ]
        }
    )

    name: str = Field(description="Name of the network.")
    scenarios: list[str] = Field(description="Scenarios whose scenes it serves.")
    r_p: float = Field(description="Ratio of its particles to those of the scene, in (0, 1].")
    r_t: int = Field(description="Number of frames that one of its steps spans.")
    latent: int = Field(description="Size of its latent vectors.")
    layers: int = Field(description="Number of its message passing layers.")
    radius: float = Field(description="Distance within which particles are neighbours [m].")
    parameters: int = Field(description="Number of its parameters.")
    solver_versions: list[int] = Field(description="Versions of the solvers that made its training data.")
    sha256: str = Field(description="SHA-256 digest of its file.")

    @classmethod
    def of(cls, name: str, entry: Entry) -> Self:
        """Describe a model of the manifest."""
        known = {field: getattr(entry, field) for field in cls.model_fields if field != "name"}
        lists = {"scenarios": list(entry.scenarios), "solver_versions": list(entry.solver_versions)}
        return cls(**known | lists | {"name": name})


class ModelList(BaseModel):
    """All networks that the server has."""

    models: list[ModelBody] = Field(
        description="Networks; the first that serves a scenario is the scenario's default."
    )


_ID = "6f0c5b0e4c7d4be59f0d0f5c3c1a2b34"
_LINK = f"/v1/sessions/{_ID}"
_LINKED = ("stream", "advance", "particles", "fork", "log", "sketches", "trajectories", "decisions")


class ControlBody(BaseModel):
    """The newest sketch of a session, and how far it has come. What is not known yet is null."""

    number: int = Field(description="Number of the sketch in its session, counted from 1.")
    kind: Literal["arrow", "ellipse"] = Field(description="Kind of the sketch.")
    phase: Phase = Field(
        description="preparing: it is being planned; an older one may steer meanwhile. steering: it leads "
        "the fluid to the goal. out_of_reach: it does so, but something is known to be in the way. holding: "
        "it keeps the goal. done: it no longer steers."
    )
    method: str | None = Field(description="Name of the method that planned.")
    first_frame: int | None = Field(description="Frame of the session at which the sketch began to steer.")
    frames_done: int = Field(description="Number of frames that the sketch has steered so far.")
    frames: int | None = Field(description="Number of frames in which the goal is to be reached.")
    hold: int | None = Field(description="Number of frames for which the goal is kept after that.")
    inside: float | None = Field(
        description="Share of the mass in the goal when `frames` were over; null before, and where an arrow "
        "carries the shape along."
    )
    inside_drawn: float | None = Field(
        description="Share of the mass in the oval as it was drawn, at the same time; null for an arrow."
    )
    miss: float | None = Field(
        description="Distance of the centre of mass from where the sketch asks it to be, at that time [m]."
    )


class LastFrameBody(BaseModel):
    """Report on the computation of the latest frame."""

    substeps: int | None = Field(
        description="Number of substeps that MPM took; null where a network made the frame."
    )
    bound: str | None = Field(
        description='Bound that chose the length of the substeps: "sound", "speed", "obstacle", "frame", '
        '"reference" or "fixed"; null where a network made the frame.'
    )
    ms: float = Field(description="Time that the simulator took for the frame [ms].")


class SessionBody(BaseModel):
    """A session: what it simulates, by which simulator, and where it stands."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": _ID,
                    "scenario": "water_2d",
                    "seed": 0,
                    "dim": 2,
                    "particles": 3210,
                    "frame": 12,
                    "time": 0.03,
                    "frame_dt": 0.0025,
                    "playing": False,
                    "speed": 0.25,
                    "centroid": [0.41, 0.52],
                    "solver": "hybrid",
                    "coarse": None,
                    "model": "fluids_2d",
                    "r_p": 0.25,
                    "mode": "mpm",
                    "safeguard": {"kind": "ours", "r_c": 0.8, "value": 0.62, "mpm_share": 0.75},
                    "control": {
                        "number": 1,
                        "kind": "arrow",
                        "phase": "steering",
                        "method": "analytic",
                        "first_frame": 10,
                        "frames_done": 2,
                        "frames": 100,
                        "hold": 0,
                        "inside": None,
                        "inside_drawn": None,
                        "miss": None,
                    },
                    "kept": "disk",
                    "notice": None,
                    "findings": [],
                    "last_frame": {"substeps": 12, "bound": "sound", "ms": 1.4},
                    "links": {
                        "self": _LINK,
                        "stream": f"{_LINK}/stream",
                        "advance": f"{_LINK}/advance",
                        "particles": f"{_LINK}/particles",
                        "fork": f"{_LINK}/fork",
                        "log": f"{_LINK}/log",
                        "sketches": f"{_LINK}/sketches",
                        "trajectories": f"{_LINK}/trajectories",
                        "decisions": f"{_LINK}/decisions",
                    },
                }
            ]
        }
    )

    id: str = Field(description="Name of the session in its address.")
    scenario: str | None = Field(
        description="Scenario that the scene was drawn from; null where a scene was sent."
    )
    seed: int | None = Field(description="Seed of the scenario; null where a scene was sent.")
    dim: Literal[2, 3] = Field(description="Dimension D of the scene.")
    particles: int = Field(
        description="Number N of particles; it changes where the scene has emitters or sinks."
    )
    frame: int = Field(description="Number of frames since the start.")
    time: float = Field(description="Simulated time since the start [s].")
    frame_dt: float = Field(description="Simulated time that a frame spans [s].")
    playing: bool = Field(description="Whether the player computes frames.")
    speed: float = Field(description="Simulated seconds per second that the player aims at.")
    centroid: list[float] | None = Field(
        description="Centre of mass, D numbers [m]; null where there is no particle."
    )
    solver: Kind = Field(description="Simulator of the session.")
    coarse: str | None = Field(
        description="CoarseLevel that few particles simulate at, carrying all others; null where none was chosen."
    )
    model: str | None = Field(description="Name of the network; null where MPM simulates alone.")
    r_p: float = Field(
        description="Ratio of the particles that are simulated to those of the scene, in (0, 1]."
    )
    mode: Mode = Field(description="Who simulates the next frame: MPM or the network.")
    safeguard: SafeguardBody | None = Field(
        description="Safeguard that watches the network; null unless the session is hybrid."
    )
    control: ControlBody | None = Field(
        description="The newest sketch; null where there was none since frame 0."
    )
    last_frame: LastFrameBody | None = Field(
        description="Report on the computation of the latest frame; null before the first."
    )
    kept: Kept = Field(
        description="Where the session is kept: in memory alone (memory), on disk, too, so that it survives "
        "a crash (disk), or in memory because the disk cannot be written at present (failing)."
    )
    notice: str | None = Field(
        description="What there is to say of a session that was computed again; null where there is nothing."
    )
    findings: list[FindingBody] = Field(
        description="What a check of the scene says without trying a frame: at most "
        f"{MOST_FINDINGS} warnings and notes, the gravest first. Scenes with errors become no session."
    )
    links: dict[str, str] = Field(
        description="Addresses of the session and of what belongs to it: "
        "self, stream, advance, particles, fork, log, sketches, trajectories, decisions."
    )

    @classmethod
    def of(cls, session: Session) -> Self:
        """Describe a session by its newest view."""
        view, control = session.view, session.control
        link = f"/v1/sessions/{session.id}"
        return cls(
            id=session.id,
            scenario=session.origin.scenario,
            seed=session.origin.seed,
            dim=session.scene.dim,
            particles=view.particles,
            frame=view.frame,
            time=view.time,
            frame_dt=session.scene.frame_dt,
            playing=session.playing,
            speed=session.speed,
            centroid=None if view.centroid is None else list(view.centroid),
            solver=session.origin.choice.solver,
            coarse=session.origin.choice.coarse,
            model=session.origin.choice.model,
            r_p=session.simulation.r_p,
            mode=view.mode,
            safeguard=None if view.safeguard is None else SafeguardBody.of(view.safeguard),
            control=None if control is None else ControlBody.model_validate(vars(control)),
            kept=session.kept,
            notice=session.notice,
            findings=FindingBody.first_of(session.findings),
            last_frame=None
            if view.last_frame is None
            else LastFrameBody(
                substeps=view.last_frame.substeps, bound=view.last_frame.bound, ms=view.last_frame.ms
            ),
            links={"self": link} | {name: f"{link}/{name}" for name in _LINKED},
        )


class SessionList(BaseModel):
    """All sessions of the server."""

    sessions: list[SessionBody] = Field(description="Sessions, oldest first.")


class ScenarioBody(BaseModel):
    """A scenario: a kind of scene that seeds draw examples of."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "name": "water_2d",
                    "dim": 2,
                    "frames": 1000,
                    "max_particles": 4000,
                    "text": "1-3 blocks of water",
                }
            ]
        }
    )

    name: str = Field(description="Name of the scenario.")
    dim: Literal[2, 3] = Field(description="Dimension of its scenes.")
    frames: int = Field(description="Number of frames that a simulation is suggested to have.")
    max_particles: int = Field(description="Largest number of particles of its scenes.")
    text: str = Field(description="What its scenes contain, in a few words.")

    @classmethod
    def of(cls, info: ScenarioInfo) -> Self:
        """Describe a scenario."""
        return cls.model_validate(
            {name: getattr(info, name) for name in ("name", "dim", "frames", "max_particles", "text")}
        )


class ScenarioList(BaseModel):
    """All scenarios of the library."""

    scenarios: list[ScenarioBody] = Field(description="Scenarios.")


class PressureBody(BaseModel):
    """Pressure in the cells of a grid where there is matter."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"frame": 12, "cell": 0.016, "points": [[0.41, 0.11]], "pressure": [1270.0]}]
        }
    )

    frame: int = Field(description="Number of frames since the start.")
    cell: float = Field(description="Side of a cell [m].")
    points: list[list[float]] = Field(description="Mean position of the particles of each cell [m].")
    pressure: list[float] = Field(description="Mean pressure of these particles [Pa].")

    @classmethod
    def of(cls, means: CellMeans) -> Self:
        """Describe means of pressures, rounded to what a picture can show."""
        return cls(
            frame=means.frame,
            cell=means.cell,
            points=means.points.round(4).tolist(),
            pressure=means.values[:, 0].round(1).tolist(),
        )


class ParticlesBody(BaseModel):
    """State of all particles of a session at one instant."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "frame": 12,
                    "time": 0.03,
                    "positions": [[0.4, 0.5]],
                    "velocities": [[0.0, -0.3]],
                    "types": [5],
                    "ids": [0],
                }
            ]
        }
    )

    frame: int = Field(description="Number of frames since the start.")
    time: float = Field(description="Simulated time since the start [s].")
    positions: list[list[float]] = Field(description="Positions; [particle][axis] [m].")
    velocities: list[list[float]] = Field(description="Velocities; [particle][axis] [m/s].")
    types: list[int] = Field(
        description="Type of each particle: 3 kinematic, 5 water, 6 sand, 7 elastic (goop)."
    )
    ids: list[int] = Field(
        description="Number that each particle keeps, ascending; new particles have larger ones."
    )

"""What the service answers, as JSON: pydantic models with examples."""

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field

from hybridmpm.scenarios import ScenarioInfo
from hybridmpm_service.http.learned_answers import SafeguardBody
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.solvers import Kind, Mode

_ID = "6f0c5b0e4c7d4be59f0d0f5c3c1a2b34"
_LINK = f"/v1/sessions/{_ID}"
_LINKED = ("stream", "advance", "particles", "sketches", "decisions")


class ControlBody(BaseModel):
    """The sketch that steers at present."""

    kind: Literal["arrow", "ellipse"]
    first_frame: int
    frames_done: int
    frames: int


class LastFrameBody(BaseModel):
    """How the latest frame was computed."""

    substeps: int | None = Field(description="Of MPM; null where a network made the frame.")
    bound: str | None = Field(
        description='What chose the step: "sound", "speed", "obstacle", "frame", "reference" or "fixed"; '
        "null where a network made the frame."
    )
    ms: float = Field(description="Solver time.")


class SessionBody(BaseModel):
    """A session."""

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
                    "model": "fluids_2d",
                    "r_p": 0.25,
                    "mode": "mpm",
                    "safeguard": {"kind": "ours", "r_c": 0.8, "value": 0.62, "mpm_share": 0.75},
                    "control": {"kind": "arrow", "first_frame": 10, "frames_done": 2, "frames": 100},
                    "last_frame": {"substeps": 12, "bound": "sound", "ms": 1.4},
                    "links": {
                        "self": _LINK,
                        "stream": f"{_LINK}/stream",
                        "advance": f"{_LINK}/advance",
                        "particles": f"{_LINK}/particles",
                        "sketches": f"{_LINK}/sketches",
                        "decisions": f"{_LINK}/decisions",
                    },
                }
            ]
        }
    )

    id: str
    scenario: str | None
    seed: int | None
    dim: Literal[2, 3]
    particles: int
    frame: int
    time: float = Field(description="Simulated [s].")
    frame_dt: float = Field(description="[s]")
    playing: bool
    speed: float = Field(description="Simulated seconds per second that the player aims at.")
    centroid: list[float] = Field(description="Centre of mass [m].")
    solver: Kind
    model: str | None = Field(description="The network; null without one.")
    r_p: float = Field(description="Particles over those of the scene.")
    mode: Mode = Field(description="Who simulates the next frame.")
    safeguard: SafeguardBody | None = Field(description="Only of a hybrid session.")
    control: ControlBody | None
    last_frame: LastFrameBody | None
    links: dict[str, str]

    @classmethod
    def of(cls, session: Session) -> Self:
        """Describe a session as it is now."""
        view = session.view
        link = f"/v1/sessions/{session.id}"
        return cls(
            id=session.id,
            scenario=session.scenario,
            seed=session.seed,
            dim=session.scene.dim,
            particles=session.simulation.particle_count,
            frame=view.frame,
            time=view.time,
            frame_dt=session.scene.frame_dt,
            playing=session.playing,
            speed=session.speed,
            centroid=list(view.centroid),
            solver=session.solver,
            model=session.model,
            r_p=session.simulation.r_p,
            mode=view.mode,
            safeguard=None if view.safeguard is None else SafeguardBody.of(view.safeguard),
            control=None
            if view.control is None
            else ControlBody(
                kind=view.control.kind,
                first_frame=view.control.first_frame,
                frames_done=view.control.frames_done,
                frames=view.control.frames,
            ),
            last_frame=None
            if view.last_frame is None
            else LastFrameBody(
                substeps=view.last_frame.substeps, bound=view.last_frame.bound, ms=view.last_frame.ms
            ),
            links={"self": link} | {name: f"{link}/{name}" for name in _LINKED},
        )


class SessionList(BaseModel):
    """All sessions, oldest first."""

    sessions: list[SessionBody]


class ScenarioBody(BaseModel):
    """A scenario."""

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

    name: str
    dim: Literal[2, 3]
    frames: int = Field(description="Suggested length.")
    max_particles: int
    text: str

    @classmethod
    def of(cls, info: ScenarioInfo) -> Self:
        """Describe a scenario."""
        return cls.model_validate(
            {name: getattr(info, name) for name in ("name", "dim", "frames", "max_particles", "text")}
        )


class ScenarioList(BaseModel):
    """All scenarios."""

    scenarios: list[ScenarioBody]


class ParticlesBody(BaseModel):
    """The state of all particles."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "frame": 12,
                    "time": 0.03,
                    "positions": [[0.4, 0.5]],
                    "velocities": [[0.0, -0.3]],
                    "types": [5],
                }
            ]
        }
    )

    frame: int
    time: float
    positions: list[list[float]] = Field(description="[particle][axis], metres.")
    velocities: list[list[float]] = Field(description="[particle][axis], metres per second.")
    types: list[int] = Field(description="3 kinematic, 5 water, 6 sand, 7 goop.")

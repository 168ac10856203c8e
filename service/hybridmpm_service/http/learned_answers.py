"""What the service answers about networks and the hybrid simulator, as JSON."""

from typing import Self

from pydantic import BaseModel, ConfigDict, Field

from hybridmpm.hybrid import Decision
from hybridmpm.physics.manifest import Entry
from hybridmpm_service.sessions.safeguard_record import Safeguard, finite
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.solvers import Mode, SafeguardKind

LATEST_DECISIONS = 16
"""In a status message; `DecisionList` has all."""


class SafeguardBody(BaseModel):
    """What a hybrid session's safeguard measures at present."""

    kind: SafeguardKind
    r_c: float = Field(description="Below this the value is alarming.")
    value: float | None = Field(description="Mean cosine in [-1, 1]; null until both windows are full.")
    mpm_share: float = Field(description="Share of the frames so far that MPM simulated.")

    @classmethod
    def of(cls, safeguard: Safeguard) -> Self:
        """Describe a safeguard."""
        return cls(
            kind=safeguard.kind,
            r_c=safeguard.r_c,
            value=safeguard.value,
            mpm_share=finite(safeguard.mpm_share) or 0.0,
        )


class DecisionBody(BaseModel):
    """From which frame on who simulates, and why."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"frame": 72, "mode": "mpm", "value": 3.4, "reason": "impact", "noticed": 72}]
        }
    )

    frame: int = Field(description="The state at its end is the first that `mode` goes on from.")
    mode: Mode
    value: float | None = Field(description="Of the guard that decided; null where there is none.")
    reason: str = Field(description='The guard, or "warm-up", "calm", "force", "unsound".')
    noticed: int = Field(description="Frame at which it was decided; later where frames were undone.")

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
    """The decisions of a session, oldest first."""

    decisions: list[DecisionBody]

    @classmethod
    def of(cls, session: Session) -> Self:
        """Describe all since frame 0."""
        safeguard = session.view.safeguard
        log = () if safeguard is None else safeguard.decisions
        return cls(decisions=[DecisionBody.of(decision) for decision in log])


class HistoryBody(BaseModel):
    """The last 1000 frames of a hybrid session."""

    frames: list[int]
    values: list[float] = Field(description="Of the safeguard, at these frames.")
    phases: list[tuple[int, Mode]] = Field(description="From which frame on who simulated.")
    decisions: list[DecisionBody] = Field(description="The latest.")

    @classmethod
    def of(cls, session: Session) -> Self | None:
        """Describe a hybrid session's history; None for another."""
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
    """A network that sessions may be simulated with."""

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
                    "sha256": "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
                }
            ]
        }
    )

    name: str
    scenarios: list[str] = Field(description="Whose scenes it serves.")
    r_p: float = Field(description="Particles over those of the scene.")
    r_t: int = Field(description="Frames that one of its steps spans.")
    latent: int
    layers: int
    radius: float = Field(description="[m]")
    parameters: int
    sha256: str

    @classmethod
    def of(cls, name: str, entry: Entry) -> Self:
        """Describe a model of the manifest."""
        known = {field: getattr(entry, field) for field in cls.model_fields if field != "name"}
        return cls(**known | {"name": name, "scenarios": list(entry.scenarios)})


class ModelList(BaseModel):
    """All models, those to be preferred first."""

    models: list[ModelBody]

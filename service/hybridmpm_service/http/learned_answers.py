"""What the service answers about networks and the hybrid simulator, as JSON."""

from typing import Self

from pydantic import BaseModel, ConfigDict, Field

from hybridmpm.hybrid import Decision
from hybridmpm.physics.manifest import Entry
from hybridmpm_service.sessions.safeguard_record import Safeguard, finite
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.solvers import Mode, SafeguardKind

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

"""What clients send, as JSON: pydantic models with examples."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, model_validator

from hybridmpm.control import Stroke
from hybridmpm.scenarios import NAMES
from hybridmpm_service.sessions.player import MAX_SPEED, MIN_SPEED
from hybridmpm_service.sessions.solvers import Kind, SafeguardKind, SolverChoice


class Request(BaseModel):
    """Base of what clients send: unknown fields and numbers that are not finite are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class CreateSession(Request):
    """A session to create: a scenario with a seed, or a scene, and the simulator."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"scenario": "water_2d", "seed": 0},
                {
                    "scene": {
                        "dim": 2,
                        "bodies": [
                            {"shape": "box", "lower": [0.3, 0.4], "upper": [0.5, 0.6], "material": "water"}
                        ],
                    }
                },
            ]
        }
    )

    scenario: str | None = Field(
        default=None,
        max_length=100,
        description=f"Scenario that the scene is drawn from: one of {', '.join(NAMES)}.",
    )
    seed: int | None = Field(
        default=None, ge=0, lt=2**53, strict=True, description="Seed of the scenario; 0 if absent."
    )
    scene: dict[str, Any] | None = Field(
        default=None,
        description="Scene of your own, in the place of a scenario, as `hybridmpm schema` describes it.",
    )
    solver: Kind = Field(
        default="mpm",
        description="Simulator: MPM (mpm), a network that MPM takes over from where a guard alarms (hybrid), "
        "or a network alone (neural).",
    )
    model: str | None = Field(
        default=None,
        max_length=100,
        description="Name of the network, from `GET /v1/models`; not with mpm. If absent, the first that "
        "serves the scenario; required with a scene.",
    )
    r_c: float | None = Field(
        default=None,
        ge=-1,
        le=1,
        strict=True,
        description="Mean cosine below which the safeguard alarms; only with hybrid, 0.8 if absent.",
    )
    safeguard: SafeguardKind | None = Field(
        default=None,
        description="Particles that the safeguard's mean is taken over: those that are not calm (ours), or "
        "all (paper). Only with hybrid; ours if absent.",
    )

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.scenario is None) == (self.scene is None):
            raise ValueError('give either "scenario" (with "seed") or "scene"')
        if self.scene is not None and self.seed is not None:
            raise ValueError('"seed" belongs to a scenario; the bodies of a scene have their own')
        return self

    def choice(self) -> SolverChoice:
        """Return the simulator that the client asks for.

        Raises
        ------
        FieldError
            An option belongs to another kind of simulator.
        """
        return SolverChoice(solver=self.solver, model=self.model, r_c=self.r_c, safeguard=self.safeguard)


class AdvanceSession(Request):
    """Number of frames to advance a session by."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"frames": 10}]})

    frames: int = Field(
        default=1,
        ge=1,
        strict=True,
        description="Number of frames to compute, at most the setting max_advance_frames.",
    )


class SteerSession(Request):
    """A sketch in its vector form, and how long it steers."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"strokes": [{"points": [[0.3, 0.5], [0.6, 0.7]], "kind": "arrow"}], "frames": 100},
            ]
        }
    )

    strokes: list[Stroke] = Field(
        min_length=1, max_length=1, description="Strokes of the sketch: exactly one."
    )
    frames: int = Field(
        default=100,
        ge=1,
        strict=True,
        description="Number of frames that the sketch steers, at most the setting max_sketch_frames.",
    )


class Play(Request):
    """Start the player."""

    type: Literal["play"]


class Pause(Request):
    """Stop the player."""

    type: Literal["pause"]


class Step(Request):
    """Stop the player, then compute some frames."""

    type: Literal["step"]
    frames: int = Field(default=1, ge=1, strict=True)


class Reset(Request):
    """Go back to frame 0; a player that runs goes on from there."""

    type: Literal["reset"]


class Speed(Request):
    """Choose how many simulated seconds the player aims at per second."""

    type: Literal["speed"]
    value: float = Field(ge=MIN_SPEED, le=MAX_SPEED)


Command = Play | Pause | Step | Reset | Speed
COMMAND: TypeAdapter[Command] = TypeAdapter(Annotated[Command, Field(discriminator="type")])
"""Reads a text message of the stream."""

"""Scenes that clients send: to create a session, to check, or to plan for."""

from typing import Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from hybridmpm.coarse import coarse_table
from hybridmpm.scenarios import NAMES
from hybridmpm.simulator import Kind
from hybridmpm_service.http.logs import LogBody
from hybridmpm_service.sessions.inputs import Strict
from hybridmpm_service.sessions.scene_work import SceneSource
from hybridmpm_service.sessions.solvers import SolverChoice

Measure = Literal["grid_rmse", "grid_nrmse", "grid_node_error", "transport", "kinetic_energy", "centroid"]
_BOX: JsonDict = {"shape": "box", "lower": [0.3, 0.4], "upper": [0.5, 0.6], "material": "water"}
_EXAMPLE: JsonDict = {"scenario": "water_2d", "seed": 0}


def _alternatives(**nulls: tuple[str, ...]) -> list[JsonDict]:
    """Return the alternatives of a body: a required field, and those that have to be null beside it."""
    types = {"scenario": "string", "scene": "object", "log": "object"}
    return [
        {
            "required": [name],
            "properties": {name: {"type": types[name]}, **{other: {"type": "null"} for other in others}},
        }
        for name, others in nulls.items()
    ]


class SceneRequest(Strict):
    """A scenario with a seed, or a scene."""

    scenario: str | None = Field(
        default=None, max_length=100, description=f"Scenario of the scene: one of {', '.join(NAMES)}."
    )
    seed: int | None = Field(default=None, ge=0, lt=2**53, strict=True)
    """Seed of the scenario; 0 if absent."""
    scene: dict[str, Any] | None = None
    """Scene of your own, in place of a scenario, as `hybridmpm schema` describes it."""

    def source(self) -> SceneSource:
        """Return the choice of the scene."""
        return SceneSource(self.scenario, None if self.scenario is None else self.seed or 0, self.scene)

    @model_validator(mode="after")
    def _one_scene(self) -> Self:
        sources = [name for name in ("scenario", "scene", "log") if name in type(self).model_fields]
        if sum(getattr(self, name) is not None for name in sources) != 1:
            names = [f'"{name}"' for name in sources]
            names[0] += ' (with "seed")'
            raise ValueError(f"give one of {', '.join(names[:-1])} and {names[-1]}")
        if self.scene is not None and self.seed is not None:
            raise ValueError('"seed" belongs to a scenario; the bodies of a scene have their own')
        return self


class CheckScene(SceneRequest):
    """A scene to check, or a scenario with a seed, and the simulator to check it for."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [*_alternatives(scenario=("scene",), scene=("scenario", "seed"))],
            "examples": [{**_EXAMPLE, "coarse": "1/16"}],
        }
    )

    solver: Kind = "mpm"
    """Simulator: MPM (mpm), a network that MPM replaces where a guard alarms (hybrid), or a network alone
    (neural)."""
    coarse: str | None = Field(
        default=None,
        max_length=100,
        description="Coarse level: the ratio of simulated to shown particles, one of "
        f"{', '.join(coarse_table().ratios)}. Only with mpm; all particles are simulated if absent.",
    )
    model: str | None = Field(default=None, max_length=100)
    """Name of the network, from `GET /v1/models`; not with mpm. If absent, the first that serves the
    scenario; required with a scene."""
    r_c: float | None = Field(default=None, ge=-1, le=1, strict=True)
    """Mean cosine below which the safeguard alarms; only with hybrid. If absent, other guards alone watch the
    network."""

    def choice(self) -> SolverChoice:
        """Return the chosen simulator.

        Raises
        ------
        FieldError
            An option belongs to another kind of simulator, or there is no such level.
        """
        return SolverChoice(solver=self.solver, coarse=self.coarse, model=self.model, r_c=self.r_c)


class CreateSession(CheckScene):
    """A session to create: a scenario with a seed, or a scene, and the simulator; or the log of a session."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                *_alternatives(
                    scenario=("scene", "log"),
                    scene=("scenario", "seed", "log"),
                    log=("scenario", "seed", "scene", "coarse", "model", "r_c"),
                )
            ],
            "examples": [_EXAMPLE, {"scene": {"dim": 2, "bodies": [_BOX]}}],
        }
    )

    log: LogBody | None = None
    """Log of a session, in place of everything else: it is computed again, which takes as long as its frames
    took."""

    @model_validator(mode="after")
    def _nothing_beside_a_log(self) -> Self:
        given = {name for name in self.model_fields_set if getattr(self, name) is not None}
        beside = sorted(given - {"log"}) if self.log is not None else []
        if beside:
            raise ValueError(f'"{beside[0]}" cannot be given beside "log", which has its own')
        return self


class PlanRequest(SceneRequest):
    """A scene, and the largest error or the longest time of its simulation."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"scenario": "water_2d", "seed": 7, "budget_ms": 0.2},
                {"scenario": "sand_3d", "max_error": 0.5, "measure": "grid_rmse"},
            ]
        }
    )

    max_error: float | None = Field(default=None, gt=0)
    """Largest mean error: the answer is the fastest method within it."""
    budget_ms: float | None = Field(default=None, gt=0)
    """Longest time of a frame [ms]: the answer is the most accurate method within it."""
    measure: Measure = "grid_rmse"
    """Measure of the error."""

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        if (self.max_error is None) == (self.budget_ms is None):
            raise ValueError('give one of "max_error" and "budget_ms"')
        return self

"""What clients send to create a session or to check a scene, as JSON."""

from typing import Any, Self

from pydantic import ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from hybridmpm import Scene, UnknownScenarioError, scenarios
from hybridmpm.coarse import coarse_table
from hybridmpm.scenarios import NAMES
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.logs import LogBody
from hybridmpm_service.http.requests import Request
from hybridmpm_service.sessions.solvers import Kind, SafeguardKind, SolverChoice

_NOT_BESIDE_A_LOG: JsonDict = {
    name: {"type": "null"} for name in ("scenario", "seed", "scene", "coarse", "model", "r_c", "safeguard")
}


class _Asked(Request):
    """A scenario with a seed, or a scene, and who simulates it."""

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
    coarse: str | None = Field(
        default=None,
        max_length=100,
        description="Part of the particles that MPM simulates at constants fitted to scenes, carrying all "
        f"others along: one of {', '.join(coarse_table().ratios)}. Only with mpm; all particles are simulated "
        "if absent.",
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
        description="Mean cosine below which the safeguard alarms; only with hybrid. If absent, other guards "
        "alone watch the network.",
    )
    safeguard: SafeguardKind | None = Field(
        default=None,
        description="Particles that the safeguard's mean is taken over: those that are not calm (ours), or "
        "all (paper). Only with hybrid; ours if absent.",
    )

    def choice(self) -> SolverChoice:
        """Return the simulator that the client asks for.

        Raises
        ------
        FieldError
            An option belongs to another kind of simulator, or there is no such level.
        """
        return SolverChoice(
            solver=self.solver,
            coarse=self.coarse,
            model=self.model,
            r_c=self.r_c,
            safeguard=self.safeguard,
        )

    def make_scene(self) -> Scene:
        """Return the scene, drawn from the scenario or read as it was sent.

        Raises
        ------
        SceneError
            The scene is not valid.
        FieldError
            There is no such scenario.
        """
        if self.scenario is None:
            return Scene.parse(self.scene)
        try:
            return scenarios.get(self.scenario, self.seed or 0)
        except UnknownScenarioError as err:
            raise FieldError("body.scenario", str(err).removeprefix("scenario: ")) from None

    def _check_seed(self) -> None:
        if self.scene is not None and self.seed is not None:
            raise ValueError('"seed" belongs to a scenario; the bodies of a scene have their own')


class CreateSession(_Asked):
    """A session to create: a scenario with a seed, or a scene, and the simulator; or the log of a session."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {
                    "required": ["scenario"],
                    "properties": {
                        "scenario": {"type": "string"},
                        "scene": {"type": "null"},
                        "log": {"type": "null"},
                    },
                },
                {
                    "required": ["scene"],
                    "properties": {
                        "scene": {"type": "object"},
                        "scenario": {"type": "null"},
                        "seed": {"type": "null"},
                        "log": {"type": "null"},
                    },
                },
                {
                    "required": ["log"],
                    "properties": {"log": {"type": "object"}, **_NOT_BESIDE_A_LOG},
                },
            ],
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
            ],
        }
    )

    log: LogBody | None = Field(
        default=None,
        description="Log of a session, in the place of everything else: it is computed again, which takes as "
        "long as its frames took.",
    )

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        given = [name for name in ("scenario", "scene", "log") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError('give one of "scenario" (with "seed"), "scene" and "log"')
        beside = sorted(self.model_fields_set - {"log"}) if self.log is not None else []
        beside = [name for name in beside if getattr(self, name) is not None]
        if beside:
            raise ValueError(f'"{beside[0]}" cannot be given beside "log", which has its own')
        self._check_seed()
        return self


class CheckScene(_Asked):
    """A scene to check, or a scenario with a seed, and the simulator that it is to be checked for."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [
                {
                    "required": ["scenario"],
                    "properties": {"scenario": {"type": "string"}, "scene": {"type": "null"}},
                },
                {
                    "required": ["scene"],
                    "properties": {
                        "scene": {"type": "object"},
                        "scenario": {"type": "null"},
                        "seed": {"type": "null"},
                    },
                },
            ],
            "examples": [{"scenario": "water_2d", "seed": 0, "coarse": "1/16"}],
        }
    )

    @model_validator(mode="after")
    def _one_of_them(self) -> Self:
        if (self.scenario is None) == (self.scene is None):
            raise ValueError('give one of "scenario" (with "seed") and "scene"')
        self._check_seed()
        return self

"""Routes of scenarios, scenes and networks, and of the health of the process.

They answer also while the server stops.
"""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from pydantic import BaseModel

from hybridmpm import scenarios
from hybridmpm_service.errors import ScenarioNotFoundError
from hybridmpm_service.http.answers import (
    ModelBody,
    ModelList,
    ScenarioBody,
    ScenarioList,
)
from hybridmpm_service.http.guard import needs
from hybridmpm_service.routes.dependencies import Sessions, problems

router = APIRouter()


@router.get("/v1/scenarios", tags=["scenarios"])
@needs("view")
async def list_scenarios() -> ScenarioList:
    """List the scenarios."""
    return ScenarioList(scenarios=[ScenarioBody.of(scenarios.describe(name)) for name in scenarios.NAMES])


@router.get("/v1/scenarios/{name}", tags=["scenarios"], responses=problems(404, 422))
@needs("view")
async def get_scene(
    name: Annotated[str, Path(description="Name of the scenario.")],
    seed: Annotated[int, Query(ge=0, lt=2**53, description="Seed that the scene is drawn with.")] = 0,
) -> dict[str, Any]:
    """Return the scene that this seed gives; it may be edited and sent to `POST /v1/sessions`."""
    if name not in scenarios.NAMES:
        known = ", ".join(scenarios.NAMES)
        raise ScenarioNotFoundError(f"there is no scenario {name[:64]!r}; there are {known}")
    return scenarios.get(name, seed).model_dump(mode="json", exclude_none=True)


@router.get("/v1/models", tags=["models"])
@needs("view")
async def list_models(sessions: Sessions) -> ModelList:
    """List the networks that may simulate sessions; the first that serves a scenario is its default."""
    return ModelList(models=[ModelBody.of(*item) for item in sessions.solvers.models.items()])


class Health(BaseModel, use_attribute_docstrings=True):
    """State of the process."""

    status: str
    """State of the process: "alive" or "ready"."""


@router.get("/livez", tags=["health"])
@needs("nothing")
async def livez() -> Health:
    """Answer that the process is alive."""
    return Health(status="alive")


@router.get("/readyz", tags=["health"], responses=problems(503))
@needs("nothing")
async def readyz(sessions: Sessions) -> Health:
    """Answer whether a session can be created now, and work goes on."""
    await sessions.expire()
    refusal = sessions.why_full() or sessions.turns.why_stuck()
    if refusal is not None:
        raise refusal
    return Health(status="ready")

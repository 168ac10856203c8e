"""Routes of the scenarios and of the scenes that are drawn from them."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query

from hybridmpm import scenarios
from hybridmpm_service.errors import ScenarioNotFoundError
from hybridmpm_service.http.answers import ScenarioBody, ScenarioList
from hybridmpm_service.routes.handling.dependencies import problems

router = APIRouter(prefix="/v1/scenarios", tags=["scenarios"])


@router.get("")
async def list_scenarios() -> ScenarioList:
    """List the scenarios."""
    return ScenarioList(scenarios=[ScenarioBody.of(scenarios.describe(name)) for name in scenarios.NAMES])


@router.get("/{name}", responses=problems(404, 422))
def get_scene(
    name: Annotated[str, Path(description="Name of the scenario.")],
    seed: Annotated[int, Query(ge=0, lt=2**53, description="Seed that the scene is drawn with.")] = 0,
) -> dict[str, Any]:
    """Return the scene that this seed gives; it may be edited and sent to `POST /v1/sessions`."""
    if name not in scenarios.NAMES:
        known = ", ".join(scenarios.NAMES)
        raise ScenarioNotFoundError(f"there is no scenario {name[:64]!r}; there are {known}")
    return scenarios.get(name, seed).model_dump(mode="json", exclude_none=True)

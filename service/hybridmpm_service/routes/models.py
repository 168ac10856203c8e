"""Route of the networks that may simulate sessions."""

from fastapi import APIRouter

from hybridmpm_service.http.learned_answers import ModelBody, ModelList
from hybridmpm_service.routes.handling.dependencies import Sessions

router = APIRouter(prefix="/v1/models", tags=["models"])


@router.get("")
async def list_models(sessions: Sessions) -> ModelList:
    """List the networks that may simulate sessions; the first that serves a scenario is its default."""
    return ModelList(models=[ModelBody.of(*item) for item in sessions.solvers.models.items()])

"""Routes for a supervisor: whether the process is alive, and whether it can take another session."""

from fastapi import APIRouter
from pydantic import BaseModel, Field

from hybridmpm_service.routes.dependencies import Sessions, problems

router = APIRouter(tags=["health"])


class Health(BaseModel):
    """State of the process."""

    status: str = Field(description='State of the process: "alive" or "ready".')


@router.get("/livez")
async def livez() -> Health:
    """Tell that the process answers."""
    return Health(status="alive")


@router.get("/readyz", responses=problems(503))
async def readyz(sessions: Sessions) -> Health:
    """Tell whether a session can be created now."""
    await sessions.expire()
    refusal = sessions.why_full()
    if refusal is not None:
        raise refusal
    return Health(status="ready")

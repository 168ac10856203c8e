"""Routes for a supervisor: liveness of the process, and readiness for another session."""

from fastapi import APIRouter
from pydantic import BaseModel

from hybridmpm_service.routes.dependencies import Sessions, problems

router = APIRouter(tags=["health"])


class Health(BaseModel, use_attribute_docstrings=True):
    """State of the process."""

    status: str
    """State of the process: "alive" or "ready"."""


@router.get("/livez")
async def livez() -> Health:
    """Answer that the process is alive."""
    return Health(status="alive")


@router.get("/readyz", responses=problems(503))
async def readyz(sessions: Sessions) -> Health:
    """Answer whether a session can be created now."""
    await sessions.expire()
    refusal = sessions.why_full()
    if refusal is not None:
        raise refusal
    return Health(status="ready")

"""Route that makes outlines of texts, pictures and SVG paths; sketches take outlines only."""

from fastapi import APIRouter

from hybridmpm_service.http.guard import needs
from hybridmpm_service.http.outlines import OutlinesBody, OutlinesRequest
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import Sessions, problems

router = APIRouter(route_class=SessionRoute)


@router.post("/v1/outlines", tags=["sketches"], responses=problems(400, 413, 415, 422, 503))
@needs("steer")
async def trace_outlines(body: OutlinesRequest, sessions: Sessions) -> OutlinesBody:
    """Return the shape of a text, a picture or an SVG path, as `sketch` of a sketch or of a keyframe."""
    return OutlinesBody.of(await sessions.turns.run(body.traced))

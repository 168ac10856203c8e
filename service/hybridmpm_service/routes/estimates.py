"""Routes that estimate a scene before a session: checks and plans."""

from fastapi import APIRouter

from hybridmpm.errors import SceneError
from hybridmpm_service.http.answers import CheckBody, PlanBody
from hybridmpm_service.http.creation import CheckScene, PlanRequest
from hybridmpm_service.http.guard import needs
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import Sessions, problems

router = APIRouter(route_class=SessionRoute)


@router.post("/v1/checks", tags=["checks"], responses=problems(413, 415, 422, 503))
@needs("create")
async def check_scene(body: CheckScene, sessions: Sessions) -> CheckBody:
    """Estimate stability, cost and risks of a scene, with remedies.

    The first frames are tried. A scene that is not valid is answered as well, with its faults as findings.
    """
    try:
        return CheckBody.of(await sessions.check(body.source(), body.choice()))
    except SceneError as error:
        return CheckBody.refused(error.with_traceback(None))


@router.post("/v1/plans", tags=["plans"], responses=problems(400, 413, 415, 422, 503))
@needs("create")
async def make_plan(body: PlanRequest, sessions: Sessions) -> PlanBody:
    """Choose the fastest method within an error, or the most accurate within a time; nothing is simulated."""
    return PlanBody.of(
        *await sessions.plan(
            body.source(), max_error=body.max_error, budget_ms=body.budget_ms, measure=body.measure
        )
    )

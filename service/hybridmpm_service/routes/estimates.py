"""Routes that estimate a scene before a session: checks and plans."""

from fastapi import APIRouter

from hybridmpm import Scene, plan, scenarios
from hybridmpm.errors import SceneError, UnknownScenarioError
from hybridmpm.planner.planning import prospective
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.creation import CheckScene
from hybridmpm_service.http.estimates import CheckBody, PlanBody, PlanRequest
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import Sessions, problems

router = APIRouter(prefix="/v1", route_class=SessionRoute)


@router.post("/checks", tags=["checks"], responses=problems(413, 415, 422, 503))
async def check_scene(body: CheckScene, sessions: Sessions) -> CheckBody:
    """Tell whether a scene runs stably, what it costs and what may go wrong, and what to change.

    A few frames are tried. A scene that is not valid is answered as well, with its faults as findings.
    """
    try:
        return CheckBody.of(await sessions.check(body.make_scene, body.scenario, body.choice()))
    except SceneError as error:
        return CheckBody.refused(error)


@router.post("/plans", tags=["plans"], responses=problems(400, 413, 415, 422, 503))
def make_plan(body: PlanRequest) -> PlanBody:
    """Choose the cheapest coarse level within an error, or the most accurate within a time; nothing is simulated."""
    scene = _scene(body)
    found = plan(scene, max_error=body.max_error, budget_ms=body.budget_ms, measure=body.measure)
    return PlanBody.of(found, [one for one, _ in prospective(scene, measure=body.measure)])


def _scene(body: PlanRequest) -> Scene:
    if body.scenario is None:
        return Scene.parse(body.scene)
    try:
        return scenarios.get(body.scenario, body.seed or 0)
    except UnknownScenarioError as err:
        raise FieldError("body.scenario", str(err).removeprefix("scenario: ")) from None

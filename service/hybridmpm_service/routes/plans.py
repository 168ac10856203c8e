"""Route of plans: which coarse level simulates a scene within an error or a time."""

from fastapi import APIRouter

from hybridmpm import Scene, plan, scenarios
from hybridmpm.errors import UnknownScenarioError
from hybridmpm.planner.planning import prospective
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.estimates.plans import PlanBody, PlanRequest
from hybridmpm_service.routes.handling.dependencies import problems

router = APIRouter(prefix="/v1/plans", tags=["plans"])


@router.post("", responses=problems(400, 422))
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

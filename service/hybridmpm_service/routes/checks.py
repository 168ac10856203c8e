"""Route that checks a scene before anybody makes a session of it."""

from fastapi import APIRouter

from hybridmpm.errors import SceneError
from hybridmpm_service.http.creation import CheckScene
from hybridmpm_service.http.estimates.checks import CheckBody
from hybridmpm_service.routes.handling.calls import SessionRoute
from hybridmpm_service.routes.handling.dependencies import Sessions, problems

router = APIRouter(prefix="/v1/checks", tags=["checks"], route_class=SessionRoute)


@router.post("", responses=problems(413, 415, 422, 503))
async def check_scene(body: CheckScene, sessions: Sessions) -> CheckBody:
    """Tell whether a scene runs stably, what it costs and what may go wrong, and what to change.

    A few frames are tried. A scene that is not valid is answered as well, with its faults as findings.
    """
    try:
        return CheckBody.of(await sessions.check(body.make_scene, body.scenario, body.choice()))
    except SceneError as error:
        return CheckBody.refused(error)

"""Routes of scenes before a session: checks, plans, and shapes in files."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field

from hybridmpm.errors import SceneError
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.answers import CheckBody, PlanBody, ShapeBody
from hybridmpm_service.http.creation import CheckScene, PlanRequest
from hybridmpm_service.http.guard import needs
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import Sessions, problems
from hybridmpm_service.sessions import scene_work

router = APIRouter(route_class=SessionRoute)

_Metres = Annotated[float, Field(ge=0, le=4096)]


class FileOfShape(BaseModel, extra="forbid", use_attribute_docstrings=True):
    """Kind of a file, and where its shape goes."""

    kind: Literal["stl", "obj", "ply", "glb", "svg", "png"]
    """Ending of the file's name."""
    height: Annotated[float, Field(gt=0, le=4096)]
    """Height of the shape [m]."""
    x: _Metres = 0.5
    """Middle of the shape along x [m]."""
    y: _Metres = 0.5
    """The same along y [m]."""
    z: _Metres = 0.5
    """The same along z [m]; only of surfaces, which are for 3D."""


_FILE: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


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


@router.post("/v1/shapes", tags=["checks"], responses=problems(413, 422, 503), openapi_extra=_FILE)
@needs("create")
async def read_shape(
    request: Request, sessions: Sessions, given: Annotated[FileOfShape, Query()]
) -> ShapeBody:
    """Return the shape in a file, which is the body of the request, as fields of a body or an obstacle."""
    center = (given.x, given.y, given.z) if given.kind in {"stl", "obj", "ply", "glb"} else (given.x, given.y)
    data = await request.body()
    found = await sessions.turns.apart(scene_work.read_shape, data, given.kind, center, given.height)
    if isinstance(found, str):
        raise FieldError("body", found)
    return ShapeBody.model_validate(found)

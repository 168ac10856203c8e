"""Routes that create, describe, advance and delete sessions."""

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from hybridmpm.errors import ExportError
from hybridmpm.export import Cloud
from hybridmpm_service.errors import FieldError
from hybridmpm_service.http.answers import DecisionList, ParticlesBody, PressureBody, SessionBody, SessionList
from hybridmpm_service.http.creation import CreateSession
from hybridmpm_service.http.guard import needs
from hybridmpm_service.http.logs import LogBody, text_of
from hybridmpm_service.http.replies import (
    NPZ,
    PLY,
    VTP,
    cloud_response,
    numbers_response,
    preferred,
)
from hybridmpm_service.http.requests import AdvanceSession
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import Here, Limits, OtherNodes, SessionId, Sessions, problems
from hybridmpm_service.sessions import scene_work
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.turns import Turns

router = APIRouter(prefix="/v1/sessions", tags=["sessions"], route_class=SessionRoute)

After = Annotated[
    float,
    Query(
        ge=0,
        le=600,
        description="Seconds until the session ends. A command on one of its streams before that keeps it. "
        "It ends earlier where a new session needs the room.",
    ),
]
START = "application/x-hybridmpm-start"
"""Media type of a start file."""
WAYS = "application/x-hybridmpm-ways"
"""Media type of the law of a sketch."""
GLB = "model/gltf-binary"
"""Media type of surfaces as glTF."""
_BINARY = {"schema": {"type": "string", "format": "binary"}}
_NPZ_CONTENT = {NPZ: _BINARY}
_PARTICLES_CONTENT = {NPZ: _BINARY, PLY: _BINARY, VTP: _BINARY}


@router.post("", status_code=201, responses=problems(413, 415, 422, 503))
@needs("create")
async def create_session(
    body: CreateSession, sessions: Sessions, limits: Limits, response: Response
) -> SessionBody:
    """Start a session from a scenario or a scene, or compute one again from its log."""
    answer = SessionBody.of(await _created(body, sessions, limits))
    response.headers["Location"] = answer.links["self"]
    return answer


async def _created(body: CreateSession, sessions: Sessions, limits: Limits) -> Session:
    sent = body.log
    if sent is not None:
        most = limits.max_sketch_frames
        scene = await sessions.turns.apart(scene_work.read_logged, sent.scene, sent.inputs, most)
        return await sessions.replay(sent.log(scene, limits.max_replay_frames))
    return await sessions.create(body.source(), body.choice())


@router.post("/{session_id}/fork", status_code=201, responses=problems(404, 503))
@needs("create")
async def fork_session(session_id: SessionId, sessions: Sessions, response: Response) -> SessionBody:
    """Start an independent session in the present state of another; it is paused."""
    answer = SessionBody.of(await sessions.fork(session_id))
    response.headers["Location"] = answer.links["self"]
    return answer


@router.get("/{session_id}/log", response_model=LogBody, responses=problems(400, 404, 503))
@needs("view")
async def get_log(session_id: SessionId, sessions: Sessions) -> Response:
    """Return the log of the session: scene, simulator and inputs since frame 0, to compute it again from."""
    return Response(await text_of(sessions.get(session_id), sessions.turns), media_type="application/json")


@router.get("", responses=problems(422))
@needs("view")
async def list_sessions(
    sessions: Sessions, peers: OtherNodes, request: Request, *, here: Here = False
) -> SessionList:
    """List the sessions, oldest first; with other nodes, theirs as well, and with keys, those of the key."""
    others, missing = ([], []) if here else await peers.rows("sessions", SessionBody, request)
    own = [SessionBody.of(session) for session in sessions.visible()]
    return SessionList(sessions=own + others, missing_nodes=missing)


@router.get("/{session_id}", responses=problems(404, 503))
@needs("view")
async def get_session(session_id: SessionId, sessions: Sessions) -> SessionBody:
    """Describe a session."""
    return SessionBody.of(sessions.get(session_id))


@router.get("/{session_id}/decisions", responses=problems(404, 503))
@needs("view")
async def get_decisions(session_id: SessionId, sessions: Sessions) -> DecisionList:
    """List all decisions between MPM and the network since frame 0; only a hybrid session has any."""
    return DecisionList.of(sessions.get(session_id))


@router.get("/{session_id}/pressure", responses=problems(404, 409, 503))
@needs("view")
async def get_pressure(session_id: SessionId, sessions: Sessions) -> PressureBody:
    """Return the pressure in the mean over the cells of a grid; only MPM computes it."""
    return PressureBody.of(await sessions.get(session_id).pressure())


@router.get(
    "/{session_id}/start",
    response_class=Response,
    responses={200: {"content": {START: _BINARY}}, **problems(404, 409, 422, 503)},
)
@needs("view")
async def get_start(session_id: SessionId, sessions: Sessions) -> Response:
    """Return what a compiled solver in a browser needs to go on from the present state; only MPM has it.

    The ETag is the digest of the state.
    """
    _, digest, data = await sessions.get(session_id).start_file()
    return Response(data, media_type=START, headers={"ETag": f'"{digest}"'})


@router.get(
    "/{session_id}/ways",
    response_class=Response,
    responses={200: {"content": {WAYS: _BINARY}}, **problems(404, 409, 422, 503)},
)
@needs("view")
async def get_ways(session_id: SessionId, sessions: Sessions) -> Response:
    """Return the law of the sketch that steers, which a compiled solver in a browser follows as well.

    Of several sketches in turn it is that of the present one. Without a sketch it is a law of no frames.
    """
    return Response(await sessions.get(session_id).ways(), media_type=WAYS)


@router.delete("/{session_id}", status_code=204, responses=problems(404, 422, 503))
@needs("create")
async def delete_session(session_id: SessionId, sessions: Sessions, *, after: After = 0.0) -> None:
    """End a session, at once or after a time; its streams close with code 4404."""
    if after > 0:
        sessions.end_later(session_id, after)
    else:
        await sessions.delete(session_id)


@router.post(
    "/{session_id}/advance",
    response_model=SessionBody,
    responses={200: {"content": _NPZ_CONTENT}, **problems(404, 413, 415, 422, 503)},
)
@needs("steer")
async def advance_session(
    session_id: SessionId, body: AdvanceSession, sessions: Sessions, limits: Limits, request: Request
) -> SessionBody | Response:
    """Compute frames; the answer is the session after them, or its particles as npz."""
    session = sessions.get(session_id)
    if body.frames > limits.max_advance_frames:
        text = f"must be in [1, {limits.max_advance_frames}], got {body.frames}"
        raise FieldError("body.frames", text)
    view = await session.advance(body.frames)
    if preferred(request, NPZ) == NPZ:
        return await _particles(sessions.turns, session, as_npz=True)
    return SessionBody.of(session, view)


@router.get(
    "/{session_id}/particles",
    response_model=ParticlesBody,
    responses={200: {"content": _PARTICLES_CONTENT}, **problems(404, 503)},
)
@needs("view")
async def get_particles(session_id: SessionId, sessions: Sessions, request: Request) -> Response:
    """Return the state of all particles as JSON, npz, or a point cloud (PLY, VTP).

    Point clouds have rigid bodies as points of type 0 that fill them.
    """
    media_type = preferred(request, NPZ, PLY, VTP)
    if media_type in {PLY, VTP}:
        recording = await sessions.get(session_id).recording()
        cloud = await sessions.turns.run(lambda: Cloud.of(recording, 0))
        return await cloud_response(sessions.turns, cloud, media_type)
    return await _particles(sessions.turns, sessions.get(session_id), as_npz=media_type == NPZ)


@router.get(
    "/{session_id}/surface",
    response_class=Response,
    responses={200: {"content": {GLB: _BINARY, PLY: _BINARY}}, **problems(404, 422, 503)},
)
@needs("view")
async def get_surface(session_id: SessionId, sessions: Sessions, request: Request) -> Response:
    """Return the surface of each material of a 3D session as triangles, glTF or PLY."""
    media_type = PLY if preferred(request, GLB, PLY) == PLY else GLB
    recording = await sessions.get(session_id).recording()
    kind = "ply" if media_type == PLY else "glb"
    try:
        data = await sessions.turns.apart(scene_work.surface_file, recording, kind)
    except ExportError as error:
        raise FieldError("path.session_id", str(error)) from None
    return Response(data, media_type=media_type)


async def _particles(turns: Turns, session: Session, *, as_npz: bool) -> Response:
    arrays = vars(await session.particles())
    return await numbers_response(turns, arrays, as_npz=as_npz)

"""Routes of links, with which others watch a session without a key of their own."""

from fastapi import APIRouter

from hybridmpm_service.errors import ServiceError
from hybridmpm_service.http.answers import LinkBody
from hybridmpm_service.http.guard import needs
from hybridmpm_service.http.requests import MakeLink
from hybridmpm_service.keys.callers import CALLER
from hybridmpm_service.routes.calls import SessionRoute
from hybridmpm_service.routes.dependencies import RingOfKeys, SessionId, Sessions, problems

router = APIRouter(prefix="/v1/sessions", tags=["sessions"], route_class=SessionRoute)


@router.post("/{session_id}/links", status_code=201, responses=problems(400, 404, 413, 415, 422, 503))
@needs("create")
async def make_link(session_id: SessionId, body: MakeLink, sessions: Sessions, ring: RingOfKeys) -> LinkBody:
    """Make a link that shows the session, and changes nothing, until it expires or is taken back."""
    session = sessions.get(session_id)
    if ring is None:
        raise ServiceError("this service has no keys, so whoever reaches it can watch: no link is needed")
    token, until = ring.link(CALLER.get(), session, session.links, body.seconds)
    return LinkBody(token=token, until=until, page=f"/?watch={session.id}#link={token}")


@router.delete("/{session_id}/links", status_code=204, responses=problems(404, 503))
@needs("create")
async def take_links_back(session_id: SessionId, sessions: Sessions) -> None:
    """Take back all links to the session that there are; streams opened by them end within a second."""
    await sessions.get(session_id).take_links_back()

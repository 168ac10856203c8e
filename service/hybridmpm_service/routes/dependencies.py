"""Dependencies of all routes: the session manager, the jobs, the settings, the OpenAPI text of problems."""

from typing import Annotated, Any

from fastapi import Depends, Path, Query
from starlette.requests import HTTPConnection

from hybridmpm_service.http.peers import Peers
from hybridmpm_service.http.problems import MEDIA_TYPE, TABLE
from hybridmpm_service.jobs import JobTable
from hybridmpm_service.keys.ring import Ring
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.settings import Settings


def _of_application(name: str) -> Any:
    # Asynchronous, since FastAPI runs other dependencies in a small pool of threads.
    async def dependency(connection: HTTPConnection) -> Any:
        return getattr(connection.app.state, name)

    return Depends(dependency)


Sessions = Annotated[SessionManager, _of_application("sessions")]
Jobs = Annotated[JobTable, _of_application("jobs")]
Limits = Annotated[Settings, _of_application("settings")]
OtherNodes = Annotated[Peers, _of_application("peers")]
RingOfKeys = Annotated[Ring | None, _of_application("ring")]
Here = Annotated[bool, Query(description="Whether other nodes are left out.")]
SessionId = Annotated[str, Path(description="Name of the session, its `id`.")]


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of a route's problems with these statuses."""
    texts: dict[int, list[str]] = {
        400: ["The form cannot be read"],
        422: ["The request is not valid"],
        413: ["The body is too large"],
    }
    for row in TABLE.values():
        texts.setdefault(row.status, []).append(row.title)
    content = {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {
        status: {"description": "; ".join(dict.fromkeys(texts[status])), "content": content}
        for status in statuses
    }

"""What all routes share: the session manager, the settings, the OpenAPI description of problems."""

from typing import Annotated, Any

from fastapi import Depends, Path
from starlette.requests import HTTPConnection

from hybridmpm_service.http.problems import MEDIA_TYPE, TABLE
from hybridmpm_service.jobs import JobTable
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.settings import Settings


def _sessions(connection: HTTPConnection) -> SessionManager:
    manager: SessionManager = connection.app.state.sessions
    return manager


def _jobs(connection: HTTPConnection) -> JobTable:
    table: JobTable = connection.app.state.jobs
    return table


def _settings(connection: HTTPConnection) -> Settings:
    settings: Settings = connection.app.state.settings
    return settings


Sessions = Annotated[SessionManager, Depends(_sessions)]
Jobs = Annotated[JobTable, Depends(_jobs)]
Limits = Annotated[Settings, Depends(_settings)]
SessionId = Annotated[str, Path(description="Name of the session, its `id`.")]


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI description of the problems that a route answers with these statuses."""
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

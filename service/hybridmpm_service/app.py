"""The application, built by `create_app`; there is no global state."""

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import Request
from starlette.responses import Response

import hybridmpm
from hybridmpm_service.errors import KeyRefusedError
from hybridmpm_service.http import files, problems
from hybridmpm_service.http.connection import AccessMiddleware, AnswerMiddleware
from hybridmpm_service.http.door import Door, client_of
from hybridmpm_service.http.guard import Guard, need_of
from hybridmpm_service.http.observed import REQUEST_ID, ObservedMiddleware
from hybridmpm_service.http.peers import Peers
from hybridmpm_service.http.requests import SketchRequest
from hybridmpm_service.http.rounds import Rounds
from hybridmpm_service.jobs import JobTable
from hybridmpm_service.keys.callers import CALLER, Quotas
from hybridmpm_service.keys.ring import Ring
from hybridmpm_service.metrics import MEDIA_TYPE, Metrics
from hybridmpm_service.routes import (
    catalogue,
    dependencies,
    estimates,
    jobs,
    links,
    outlines,
    sessions,
    sketches,
    stream,
)
from hybridmpm_service.routes.calls import Idempotency
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.sessions.player import Clock
from hybridmpm_service.settings import Settings

_SWEEP_SECONDS = 30.0
"""Longest time between two searches for idle sessions."""

_LOCAL = frozenset({"127.0.0.1", "::1/128", "::1"})
_FORWARDED = frozenset({"x-forwarded-for", "forwarded"})

_log = logging.getLogger(__name__)


def create_app(settings: Settings | None = None, *, clock: Clock = time.perf_counter) -> FastAPI:
    """Return the application: API, stream and page.

    Parameters
    ----------
    settings : Settings, optional
        Settings of the service; read from the environment if absent.
    clock : Clock
        Clock for idle times and players.

    Raises
    ------
    ConfigError
        The file of keys, the folder of sessions or the folder of models cannot be used.
    """
    settings = settings or Settings.load()
    app = FastAPI(
        title="hybridmpm",
        version=hybridmpm.__version__,
        description="Interactive particle fluids: create sessions, watch them live, steer them by sketches. "
        "Positions are in metres in the box [0, 1]^D with y up, times in seconds.",
        # The usual documentation pages load scripts from other servers, which the security policy forbids.
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        lifespan=_lifespan,
    )
    app.state.settings = settings
    app.state.ring = ring = Ring(Path(settings.keys)) if settings.keys else None
    quotas = Quotas()
    if ring is not None:
        quotas.of = ring.quota
    app.state.sessions = SessionManager(settings, clock, quotas)
    app.state.rounds = Rounds()
    app.state.idempotency = Idempotency()
    app.state.jobs = JobTable(settings.max_jobs, settings.idle_seconds, clock, settings.node, quotas)
    app.state.peers = Peers(settings.peers)
    app.state.metrics = Metrics(app.state.sessions, app.state.jobs)
    problems.install(app)
    modules = (catalogue, estimates, outlines, sessions, links, sketches, jobs, stream)
    routers = [module.router for module in modules]
    for router in routers:
        app.include_router(router)
    routes = [route for router in routers for route in router.routes]
    app.state.operations = [route for route in routes if isinstance(route, APIRoute)]
    for route in routes:
        need_of(route)
    for path in ("/", "/index.html"):
        app.add_route(path, files.front, methods=["GET", "HEAD"], include_in_schema=False)
    app.add_route("/embed", files.framed, methods=["GET", "HEAD"], include_in_schema=False)
    if settings.metrics != "off":
        app.add_route("/metrics", _metrics, methods=["GET", "HEAD"], include_in_schema=False)
    app.router.routes.append(files.FilesRoute(files.page_files()))
    # The last one added is the outermost.
    app.add_middleware(
        Door,
        max_bytes=settings.max_body_bytes,
        operations=app.state.operations,
        draining=app.state.sessions.draining,
        rounds=app.state.rounds,
        guard=None if ring is None else Guard(ring, routes),
    )
    if settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=settings.cors_origins,
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=["Authorization", "Content-Type", "Idempotency-Key", "Prefer"],
            expose_headers=["Location", "Retry-After", REQUEST_ID],
        )
    app.add_middleware(AccessMiddleware, hosts=settings.hosts, origins=settings.cors_origins)
    app.add_middleware(AnswerMiddleware, origins=settings.cors_origins)
    app.add_middleware(ObservedMiddleware, metrics=app.state.metrics, operations=app.state.operations)
    _document(app)
    return app


@contextlib.asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    manager: SessionManager = app.state.sessions
    settings: Settings = app.state.settings
    jobs: JobTable = app.state.jobs
    # The server answers meanwhile; requests for these sessions are refused with a Retry-After.
    reviving = asyncio.create_task(manager.revive())
    sweeping = asyncio.create_task(_sweep(manager, jobs, min(_SWEEP_SECONDS, settings.idle_seconds / 4)))
    try:
        yield
    finally:
        sweeping.cancel()
        await asyncio.gather(reviving, jobs.close(), manager.close())


async def _sweep(manager: SessionManager, jobs: JobTable, seconds: float) -> None:
    """End idle sessions and forget old jobs regularly, until this task is cancelled."""
    while True:
        await asyncio.sleep(seconds)
        try:
            jobs.expire()
            await manager.expire()
        except Exception:  # noqa: BLE001 - the next sweep may succeed, and must come
            _log.exception("ending idle sessions failed; trying again")


def _metrics(request: Request) -> Response:
    """Return the metrics, where the client may read them."""
    # Whoever comes by a proxy is elsewhere, whatever address the proxy was told.
    is_local = client_of(request.scope).address in _LOCAL and not _FORWARDED & set(request.headers)
    if request.app.state.settings.metrics == "local" and not is_local:
        raise HTTPException(403, "metrics are for programs on this machine; --metrics all shows them to all")
    if request.app.state.ring is not None and not is_local and not CALLER.get().may("view"):
        raise KeyRefusedError("metrics need a key, but for programs on this machine")
    return Response(request.app.state.metrics.text(), media_type=MEDIA_TYPE)


def _document(app: FastAPI) -> None:
    """Complete the OpenAPI document with the schemas that routes name."""
    generate = app.openapi

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = generate()
            schemas = document["components"]["schemas"]
            for model in (problems.Problem, SketchRequest):
                schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
                schemas.update(schema.pop("$defs", {}))
                schemas[model.__name__] = schema
            _without_foreign_errors(document)
            _with_keys(document, app.state.operations)
        return app.openapi_schema or {}

    # This is the way that FastAPI documents.
    app.openapi = openapi  # type: ignore[method-assign]


def _without_foreign_errors(document: dict[str, Any]) -> None:
    """Remove FastAPI's own description of a 422, which it adds to every path with a parameter."""
    for item in document["paths"].values():
        for operation in item.values():
            answers = operation["responses"]
            if problems.MEDIA_TYPE not in answers.get("422", {}).get("content", {}):
                answers.pop("422", None)
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)


def _with_keys(document: dict[str, Any], operations: Sequence[APIRoute]) -> None:
    """Add the keys, the scope that each operation needs, and its refusals."""
    document["components"]["securitySchemes"] = {
        "key": {
            "type": "http",
            "scheme": "bearer",
            "description": "A key, or a link to a session, where the service has keys.",
        }
    }
    refusals = dependencies.problems(401, 403, 429)
    for route in operations:
        need = need_of(route)
        for method in route.methods or ():
            operation = document["paths"][route.path][method.lower()]
            # The first of the two is for a service without keys.
            operation["security"] = [] if need == "nothing" else [{}, {"key": [need]}]
            for status in () if need == "nothing" else (401, 403, *((429,) if need == "create" else ())):
                operation["responses"][str(status)] = refusals[status]

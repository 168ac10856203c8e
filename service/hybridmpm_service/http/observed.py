"""Each request has an identifier, a line in the log, and its place in the metrics."""

import json
import logging
import re
import time
import uuid
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from typing import Any

from fastapi.routing import APIRoute
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hybridmpm_service.http import problems
from hybridmpm_service.http.door import client_of
from hybridmpm_service.http.guard import KEY_NAME
from hybridmpm_service.keys.file import KEY_START, LINK_START
from hybridmpm_service.metrics import Metrics

REQUEST_ID = "X-Request-ID"
_ID = re.compile(r"[\w.-]{1,64}", re.ASCII)
"""Identifiers that are taken over from a client or a proxy."""
_TOKEN = re.compile(rf"({KEY_START}|{LINK_START})[\w.-]+", re.ASCII)
"""Tokens of keys and links, which a client may send where none belongs."""
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_request: ContextVar[str] = ContextVar("request", default="-")
_log = logging.getLogger("hybridmpm_service.access")


class ObservedMiddleware:
    """The outermost middleware: what it sees is what the client gets.

    Parameters
    ----------
    app : ASGI application
    metrics : Metrics
    operations : sequence of APIRoute
        Operations whose addresses the metrics name; all others count as the page.
    """

    def __init__(self, app: ASGIApp, metrics: Metrics, operations: Sequence[APIRoute]) -> None:
        self._app, self._metrics = app, metrics
        self._routes = [(one.path_regex, one.path) for one in operations]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        began = time.monotonic()
        given = Headers(scope=scope).get(REQUEST_ID, "")
        is_good = _ID.fullmatch(given) and not _TOKEN.search(given)
        identifier = given if is_good else uuid.uuid4().hex
        token = _request.set(identifier)
        answer = _Answer(send, identifier, lambda: self._note(scope, answer, time.monotonic() - began))
        try:
            await self._app(scope, receive, answer.send)
        finally:
            answer.end()
            _request.reset(token)

    def _note(self, scope: Scope, answer: "_Answer", seconds: float) -> None:
        # A stream has no method; its status is that of the handshake.
        method = scope.get("method", "STREAM")
        path = scope["path"]
        named = (name for pattern, name in self._routes if pattern.match(path))
        route = "stream" if method == "STREAM" else next(named, "page")
        known = method if method in _METHODS | {"STREAM"} else "other"
        self._metrics.requests.labels(known, route, answer.status).inc()
        if method != "STREAM":
            self._metrics.seconds.labels(route).observe(seconds)
        if answer.kind:
            self._metrics.refusals.labels(answer.kind).inc()
        if _log.isEnabledFor(logging.INFO):
            client = client_of(scope).address
            # As it was sent: decoded, a path may contain the end of a line.
            path = _TOKEN.sub(r"\1...", scope.get("raw_path", b"").decode("latin-1"))
            about = {"client": client, "method": method, "path": path, "status": answer.status}
            about |= {"seconds": round(seconds, 4), "bytes": answer.bytes}
            if KEY_NAME in scope:
                about["key"] = scope[KEY_NAME]
                client = f"{client} {scope[KEY_NAME]}"
            _log.info("%s %s %s %d %.4f s", client, method, path, answer.status, seconds, extra=about)


class _Answer:
    """What log and metrics need of an answer; its status is 0 if the client goes before it."""

    def __init__(self, send: Send, identifier: str, note: Callable[[], object]) -> None:
        self._send, self._identifier, self._note = send, identifier, note
        self.status = self.bytes = 0
        self.kind: str | None = None
        self._is_problem = self._ended = False

    def end(self) -> None:
        """Note the request, once."""
        if not self._ended:
            self._ended = True
            self._note()

    async def send(self, message: Message) -> None:
        """Pass a message on."""
        if message["type"] in {"http.response.start", "websocket.http.response.start"}:
            self.status = message["status"]
            headers = MutableHeaders(raw=message["headers"])
            headers[REQUEST_ID] = self._identifier
            message["headers"] = headers.raw
            self._is_problem = headers.get("content-type", "").startswith(problems.MEDIA_TYPE)
        elif message["type"] in {"http.response.body", "websocket.http.response.body"}:
            body = message.get("body", b"")
            self.bytes += len(body)
            if self._is_problem and body:
                self.kind = _kind(body)
            if not message.get("more_body", False):
                # Before the client has its answer, so that its next request finds this one in the metrics.
                self.end()
        elif message["type"] == "websocket.accept":
            self.status = 101
        elif message["type"] == "websocket.close" and not self.status:
            self.status = 403
        await self._send(message)


def _kind(body: bytes) -> str:
    """Return the last part of the type of a problem."""
    try:
        found: Any = json.loads(body)["type"]
    except (ValueError, KeyError, TypeError):
        return "other"
    return str(found).rpartition(":")[2]


class WithRequest(logging.Filter):
    """Gives each line of the log the identifier of the request that it is about, and takes tokens out."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Add `request`; pass the line on."""
        record.request = _request.get()
        text = record.getMessage()
        if _TOKEN.search(text):
            # At the level debug, websockets logs the headers of streams.
            record.msg, record.args = _TOKEN.sub(r"\1...", text), ()
        return True


def log_config(level: str, kind: str) -> dict[str, Any]:
    """Return the configuration of the log, of uvicorn as well, for `logging.config.dictConfig`."""
    fields = "%(asctime)s %(levelname)s %(name)s %(request)s %(message)s"
    formatter: dict[str, Any] = {"format": fields}
    if kind == "json":
        formatter["()"] = "pythonjsonlogger.json.JsonFormatter"
        formatter["rename_fields"] = {"asctime": "time", "levelname": "level", "name": "logger"}
    handler = {"class": "logging.StreamHandler", "formatter": "line", "filters": ["request"]}
    # The root is left to programs that run the service within themselves.
    logger = {"level": level.upper(), "handlers": ["errors"]}
    return {
        "version": 1,
        "disable_existing_loggers": False,
        "filters": {"request": {"()": WithRequest}},
        "formatters": {"line": formatter},
        "handlers": {"errors": handler},
        "loggers": dict.fromkeys(("hybridmpm_service", "uvicorn", "asyncio"), logger),
    }

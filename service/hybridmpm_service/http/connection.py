"""Limits below the routes: middleware of every request, and uvicorn's protocols with deadlines.

The protocols subclass private classes of uvicorn. Its public settings have no deadline for the head and body
of a request, none for a stream whose client does not read, and no limit that counts silent connections. A
proxy in front would close these holes only for those who run one. Tests of slow clients guard the overrides.
"""

import asyncio
import logging
from collections.abc import Collection, Mapping
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

import h11
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from hybridmpm_service.http.problems import MEDIA_TYPE, RETRY_AFTER_SECONDS, of_status

_log = logging.getLogger(__name__)

SECURITY_HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": (
        "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; object-src 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    # A browser may keep a file of the page, but has to revalidate it each time.
    "Cache-Control": "no-cache",
}
_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_KEPT_HEADERS = ("allow", "retry-after", "vary", "access-control-allow-origin")


class AnswerMiddleware:
    """Middleware that adds the security headers to every answer and turns every failure into a problem.

    It is the outermost one: the others, and a fault of the service, would answer in plain text.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        answer = _Answer(scope, receive, send)
        try:
            await self._app(scope, receive, answer.send_or_replace)
        except Exception:
            _log.exception("%s %s failed", scope["method"], scope["path"])
            if answer.started:
                raise
            await answer.replace(500, "the server failed; the cause is in its log; other sessions go on")


class _Answer:
    """One answer on its way to the client."""

    def __init__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self._scope = scope
        self._receive = receive
        self._send = send
        self._replaced = False
        self.started = False

    async def send_or_replace(self, message: Message) -> None:
        """Pass a message on; replace a failure in another format by a problem."""
        if message["type"] == "http.response.start":
            self.started = True
            headers = Headers(raw=message["headers"])
            if message["status"] >= 400 and not headers.get("content-type", "").startswith(MEDIA_TYPE):
                self._replaced = True
                detail = f"{self._scope['method']} {self._scope['path']} is refused"
                kept = {name: headers[name] for name in _KEPT_HEADERS if name in headers}
                await self.replace(message["status"], detail, kept)
        if not self._replaced:
            await self._send_with_headers(message)

    async def replace(self, status: int, detail: str, headers: dict[str, str] | None = None) -> None:
        """Send a problem with this status in place of the answer."""
        answer = of_status(self._scope["path"], status, detail, headers)
        await answer(self._scope, self._receive, self._send_with_headers)

    async def _send_with_headers(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(raw=message["headers"])
            for name, value in SECURITY_HEADERS.items():
                headers.setdefault(name, value)
            message["headers"] = headers.raw
        await self._send(message)


class AccessMiddleware:
    """Middleware that refuses requests of foreign web sites through the user's browser.

    Parameters
    ----------
    app : ASGI application
    hosts : collection of str, or None
        Allowed names in the Host header; None for any. Without this check a site could point its own name at
        127.0.0.1 and read everything.
    origins : collection of str
        Other origins that may change sessions and open streams. Browsers send forms and open WebSockets
        across sites without a preflight request.
    """

    def __init__(self, app: ASGIApp, hosts: Collection[str] | None, origins: Collection[str]) -> None:
        self._app = app
        self._hosts = hosts
        self._origins = origins

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refusal = None if scope["type"] == "lifespan" else self._refusal(scope)
        if refusal is None:
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            # Before the handshake is accepted this becomes a 403.
            await send({"type": "websocket.close", "code": 1008, "reason": refusal[1]})
        else:
            await of_status(scope["path"], *refusal)(scope, receive, send)

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        headers = Headers(scope=scope)
        host, origin = headers.get("host"), headers.get("origin")
        is_safe = scope["type"] == "http" and scope["method"] in _SAFE_METHODS
        # A load balancer's check in HTTP/1.0 may have no Host. A browser, which a site misleads, has one.
        is_check = host is None and is_safe and scope["http_version"] == "1.0"
        if self._hosts is not None and not is_check and _host_name(host or "") not in self._hosts:
            allowed = ", ".join(self._hosts)
            return (
                421,
                f"Host {host or ''!r} is not served here; allowed are {allowed} (setting allowed_hosts)",
            )
        if origin is not None and (origin in self._origins or urlsplit(origin).netloc == host):
            return None
        if origin is not None and not is_safe:
            return 403, f"Origin {origin!r} may not change anything here (setting cors_origins)"
        site = headers.get("sec-fetch-site", "none")
        is_link = is_safe and headers.get("sec-fetch-mode") == "navigate"
        if site in {"cross-site", "same-site"} and not is_link:
            return 403, f"a page of another site may not use this service (Sec-Fetch-Site {site})"
        return None


def _host_name(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


_SURPLUS_SECONDS = 1.0
"""Longest time for a connection beyond the limit to send a request, which is refused."""
_CLOSE_SECONDS = 1.0
"""Longest time for a client to confirm the end of its stream."""


class RequestProtocol(H11Protocol):
    """HTTP with a deadline of `seconds` for a whole request, its head and its body.

    Connections beyond `most`, streams included, are refused at their first request.
    """

    seconds: float
    most: int
    _surplus = False
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the deadline of a new connection."""
        super().connection_made(transport)
        self._surplus = len(self.connections) > self.most
        self._expect()

    def data_received(self, data: bytes) -> None:
        """Read a part of a request; start or end its deadline."""
        if self._surplus:
            text = f"all {self.most} connections of this server are in use: close one, or try again later"
            self._refuse(503, text)
            return
        super().data_received(data)
        if self.transport.get_protocol() is not self:
            # The connection has become a stream, which has deadlines of its own.
            return
        # Between requests uvicorn has a deadline of its own, which ends with the first byte of the next.
        if self.conn.their_state in {h11.IDLE, h11.SEND_BODY} and not self.transport.is_closing():
            self._expect()
        else:
            self._relax()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the deadline."""
        self._relax()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:
        """Refuse a request that is not HTTP."""
        self._refuse(400, msg)

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Switch the connection to the protocol of streams."""
        self._relax()
        super().handle_websocket_upgrade(event)

    def _expect(self) -> None:
        if self._deadline is None:
            seconds = _SURPLUS_SECONDS if self._surplus else self.seconds
            self._deadline = self.loop.call_later(seconds, self._on_deadline)

    def _relax(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _on_deadline(self) -> None:
        self._deadline = None
        if self.conn.their_state is h11.IDLE and not self.conn.trailing_data[0]:
            # A browser may connect in advance, without a request.
            self.transport.close()
            return
        self._refuse(408, f"the request was not complete after {self.seconds:g} s")

    def _refuse(self, status: int, detail: str) -> None:
        """Answer a problem in place of the application, and close the connection."""
        if self.transport.is_closing():
            return
        if self.conn.our_state in {h11.IDLE, h11.SEND_RESPONSE}:
            path = self.scope["path"] if self.scope is not None else "/"
            headers = {"Retry-After": str(RETRY_AFTER_SECONDS)} if status == 503 else {}
            answer = of_status(path, status, detail, headers | {"Connection": "close"})
            for part in (
                h11.Response(
                    status_code=status,
                    headers=answer.raw_headers,
                    reason=HTTPStatus(status).phrase.encode(),
                ),
                h11.Data(data=bytes(answer.body)),
                h11.EndOfMessage(),
            ):
                self.transport.write(self.conn.send(part) or b"")
        self.transport.close()


class StreamProtocol(WebSocketsSansIOProtocol):
    """WebSockets whose connection ends soon after their stream, even if the client does not read."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.close_timeout = _CLOSE_SECONDS

    def handle_ping(self) -> None:
        """Answer a ping, unless the client has not read earlier messages."""
        if self.writable.is_set():
            super().handle_ping()
        else:
            self.conn.data_to_send()

    async def run_asgi(self) -> None:
        """Serve a stream; unread messages are dropped at its end."""
        await super().run_asgi()
        if not self.writable.is_set():
            self.transport.abort()


def request_protocol(seconds: float, most: int) -> type[RequestProtocol]:
    """Return the protocol with a deadline and a limit of connections, for uvicorn's configuration."""
    return type("RequestProtocol", (RequestProtocol,), {"seconds": seconds, "most": most})

"""Limits below the routes: middleware of every request, and uvicorn's protocols with deadlines.

The protocols subclass private classes of uvicorn. Its public settings have no deadline for the head and body
of a request, none for a stream whose client does not read, and no limit that counts silent connections. A
proxy in front would close these holes only for those who run one. Tests of slow clients guard the overrides.
"""

import asyncio
import logging
import socket
import time
from collections.abc import Collection, Mapping
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

import h11
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

from hybridmpm_service.http.problems import MEDIA_TYPE, RETRY_AFTER_SECONDS, of_status
from hybridmpm_service.http.rounds import Rounds
from hybridmpm_service.sessions.player import Clock
from hybridmpm_service.sessions.turns import Client
from hybridmpm_service.settings import Settings

_log = logging.getLogger(__name__)

SECURITY_HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": (
        "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'; object-src 'none'"
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

    It is the outermost one: the others, and a fault of the service, would answer in plain text. Pages of
    `origins` may read these answers, too.
    """

    def __init__(self, app: ASGIApp, origins: Collection[str] = ()) -> None:
        self._app, self._origins = app, origins

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        answer = _Answer(scope, receive, send, self._origins)
        try:
            await self._app(scope, receive, answer.send_or_replace)
        except Exception:
            _log.exception("%s %s failed", scope["method"], scope["path"])
            if answer.started:
                raise
            await answer.replace(500, "the server failed; the cause is in its log; other sessions go on")


class _Answer:
    """One answer on its way to the client."""

    def __init__(self, scope: Scope, receive: Receive, send: Send, origins: Collection[str]) -> None:
        self._scope = scope
        self._origins = origins
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
            origin = Headers(scope=self._scope).get("origin")
            if origin and origin in self._origins and "access-control-allow-origin" not in headers:
                headers["access-control-allow-origin"] = origin
                headers.add_vary_header("Origin")
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
            return 403, (
                f"a page of another site may not use this service (Sec-Fetch-Site {site}): its "
                "origin belongs into the setting cors_origins"
            )
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
FIRST = "hybridmpm.first"
"""Name in the state of a scope: whether it is of the first request of its connection."""
SURPLUS = 32
"""Number of connections beyond the limit that get an answer."""
_PARTS, _PART_BYTES = 64, 256
"""Parts of a request of any length, and mean length of further ones [bytes]."""
_READ_BYTES = 1024
"""Bytes of a stream that are read at once; 500 frames need at least as many."""
_UNSENT_BYTES = 16 * 1024
"""Bytes of a stream that wait for a slow line, at most one message more; what waits shows old frames."""
_READ_COST = 0.25
"""Tokens of a read that completes no frame."""


class RequestProtocol(H11Protocol):
    """HTTP with a deadline of `seconds` for a whole request, its head and its body.

    Parts of a body and reads have to be `_PART_BYTES` long in the mean. A client may take `send_seconds` for
    the next `_PIECE_BYTES` of an answer. Connections beyond `most`, streams included, are refused at their
    first request, and some more are closed at once.
    """

    rounds: Rounds
    seconds: float
    send_seconds: float
    most: int
    _surplus = False
    _deadline: asyncio.TimerHandle | None = None
    _unread: asyncio.TimerHandle | None = None
    _parts = _bytes = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the deadline of a new connection."""
        super().connection_made(transport)
        self.app_state = dict(self.app_state)
        self._surplus = len(self.connections) > self.most
        if len(self.connections) > self.most + SURPLUS:
            transport.abort()
            return
        next_event = self.conn.next_event

        def counted() -> Any:
            event = next_event()
            if type(event) is h11.Data:
                self._count(len(event.data))
            return event

        self.conn.next_event = counted  # type: ignore[method-assign]
        self._expect()

    def data_received(self, data: bytes) -> None:
        """Read a part of a request in its turn."""
        is_first = self.cycle is None
        self._unset_keepalive_if_required()

        def read() -> None:
            if not self.transport.is_closing():
                self.app_state[FIRST] = is_first
                self._read_part(data)
                if not self.flow.read_paused:
                    self.transport.resume_reading()

        if not self.rounds.do(_client(self.client, is_first=is_first), read):
            self.transport.pause_reading()
            # It is not the client that is late now.
            self._relax()

    def _read_part(self, data: bytes) -> None:
        """Read a part of a request; start or end its deadline."""
        if isinstance(protocol := self.transport.get_protocol(), StreamProtocol):
            # The connection has become one meanwhile.
            protocol.data_received(data)
            return
        if self._surplus:
            text = f"all {self.most} connections of this server are in use: close one, or try again later"
            self._refuse(503, text)
            return
        if self.conn.their_state is not h11.SEND_BODY:
            self._parts = self._bytes = 0
        try:
            self._count(len(data))
        except h11.RemoteProtocolError as error:
            self._refuse(400, str(error))
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

    def _count(self, size: int) -> None:
        """Count a read, or a chunk of a body; each takes the time of some hundred bytes."""
        self._parts, self._bytes = self._parts + 1, self._bytes + size
        if self._parts > _PARTS + self._bytes / _PART_BYTES:
            raise h11.RemoteProtocolError("the request comes in too small parts")

    def pause_writing(self) -> None:
        """Start the deadline of a client that does not read its answer."""
        self.flow.pause_writing()
        if self._unread is None:
            self._unread = self.loop.call_later(self.send_seconds, self.transport.abort)

    def resume_writing(self) -> None:
        """End the deadline of a client that has read."""
        self.flow.resume_writing()
        self._read()

    def _read(self) -> None:
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None

    def connection_lost(self, exc: Exception | None) -> None:
        """End the deadlines, and what would keep this object until a search for circles."""
        self._relax()
        self._read()
        super().connection_lost(exc)
        self.cycle = None  # type: ignore[assignment]
        vars(self.conn).pop("next_event", None)

    def send_400_response(self, msg: str) -> None:
        """Refuse a request that is not HTTP."""
        self._refuse(400, msg)

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Switch the connection to the protocol of streams."""
        self._relax()
        self._read()
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


def _client(peer: tuple[str, int] | None, *, is_first: bool) -> Client:
    """Return the client of a connection from a peer, for its turns."""
    host, port = peer or ("", 0)
    return Client(host, 0 if is_first else port)


class Throttle:
    """Token bucket that fills with `rate` tokens a second up to `burst`; a frame takes one for each KiB.

    Parameters
    ----------
    rate : float > 0
        Small messages a second [1/s].
    burst : int >= 1
        Small messages at once after a pause.
    clock : Clock
    """

    def __init__(self, rate: float, burst: int, clock: Clock) -> None:
        self._rate, self._burst, self._clock = rate, burst, clock
        self._tokens = float(burst)
        self._latest = clock()

    def admits(self, tokens: float) -> bool:
        """Take some tokens; return False where too few are left."""
        now = self._clock()
        self._tokens = min(self._burst, self._tokens + (now - self._latest) * self._rate)
        self._latest = now
        if self._tokens < tokens:
            return False
        self._tokens -= tokens
        return True


class StreamProtocol(WebSocketsSansIOProtocol):
    """WebSockets whose clients are metered, and whose connection ends soon after their stream.

    Whatever a client sends is metered here, before anything else sees it: messages and their fragments,
    control frames, and reads that complete no frame.
    """

    rounds: Rounds
    rate: float
    burst: int

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.close_timeout = _CLOSE_SECONDS
        self._throttle = Throttle(self.rate, self.burst, time.monotonic)
        self._flooded = False
        self._unread = bytearray()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Bound what waits for the line, here and in the system."""
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=_UNSENT_BYTES)
        if hasattr(socket, "TCP_NOTSENT_LOWAT"):  # on Linux and macOS
            end = transport.get_extra_info("socket")
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _UNSENT_BYTES)

    def data_received(self, data: bytes) -> None:
        """Read some bytes in turn, in pieces, so that none has frames for long; none after a flood."""
        waits = bool(self._unread)
        self._unread += data
        if not waits:
            self._await_turn()

    def _await_turn(self) -> None:
        """Read the next piece when its turn comes; until all pieces are read, nothing new is."""

        def read() -> None:
            piece = bytes(self._unread[:_READ_BYTES])
            del self._unread[:_READ_BYTES]
            if self._flooded or self.transport.is_closing():
                self._unread.clear()
                return
            super(StreamProtocol, self).data_received(piece)
            if self._unread:
                self._await_turn()
            elif not self.read_paused:
                self.transport.resume_reading()

        if not self.rounds.do(_client(self.client, is_first=False), read):
            self.transport.pause_reading()

    async def receive(self) -> Any:
        """Return the next message; the end of a full queue resumes no reading while pieces wait."""
        message = await super().receive()
        if self._unread:
            self.transport.pause_reading()
        return message

    def handle_events(self) -> None:
        """Meter what was read, then handle it."""
        if self.handshake_complete and not self.close_sent:
            frames = [event for event in self.conn.events if isinstance(event, Frame)]
            cost = sum(1 + len(frame.data) // 1024 for frame in frames) or _READ_COST
            if not self._throttle.admits(cost):
                self._end_flood()
                return
        super().handle_events()

    def _end_flood(self) -> None:
        """Close the stream of a client that sends too much; what it still sends is not looked at."""
        self._flooded = True
        reason = f"at most {self.rate:g} messages a second, {self.burst} at once"
        self.conn.fail(1008, reason)
        self.transport.write(b"".join(self.conn.data_to_send()))
        self.close_sent = True
        self.queue.put_nowait({"type": "websocket.disconnect", "code": 1008, "reason": reason})
        # Closed at once, unread bytes would make the system drop the last message; while the timer runs,
        # the end of the application does not close the connection.
        self.transport.resume_reading()
        self.close_timer = self.loop.call_later(_CLOSE_SECONDS, self.transport.abort)

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


def request_protocol(settings: Settings, rounds: Rounds) -> type[RequestProtocol]:
    """Return the protocol of requests with the limits of some settings, for uvicorn's configuration."""
    limits = {
        "rounds": rounds,
        "seconds": settings.request_seconds,
        "send_seconds": settings.send_seconds,
        "most": settings.max_connections,
    }
    return type("RequestProtocol", (RequestProtocol,), limits)


def stream_protocol(settings: Settings, rounds: Rounds) -> type[StreamProtocol]:
    """Return the protocol of streams with the limits of some settings, for uvicorn's configuration."""
    limits = {
        "rounds": rounds,
        "rate": settings.max_messages_per_second,
        "burst": settings.max_messages_at_once,
    }
    return type("StreamProtocol", (StreamProtocol,), limits)

"""The door: what every request passes, whatever its route. Routes need no guards of their own.

A body is read here: its size, the number of its values while it arrives, and the memory of all bodies are
bounded. Work ends when its client has gone. Large answers leave in pieces, and their memory is bounded. Each
request carries its client, for the shares of clients, and its caller, where there are keys. HEAD works
wherever GET does.
"""

import asyncio
import ipaddress
from collections.abc import Callable, Sequence

from fastapi.routing import APIRoute
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hybridmpm_service.errors import ServiceError, UnavailableError, UnsupportedFormatError
from hybridmpm_service.http.connection import FIRST
from hybridmpm_service.http.guard import Guard
from hybridmpm_service.http.problems import ended, of_status, response_of
from hybridmpm_service.http.requests import Values
from hybridmpm_service.http.rounds import Rounds
from hybridmpm_service.keys.callers import CALLER
from hybridmpm_service.sessions.turns import CLIENT, Client

MAX_BODIES_BYTES = 1 << 27
"""Largest memory of all bodies that are being received or worked on [bytes]."""
MAX_ANSWERS_BYTES = 1 << 28
"""Largest memory of all answers that are being sent [bytes]."""
_PIECE_BYTES = 1 << 16
"""Largest part of an answer that is sent at once; smaller bodies and answers count as nothing."""
_BODILESS_BYTES = 1 << 12
"""Largest body of a request whose method needs none."""
_WITH_BODY = frozenset({"POST", "PUT", "PATCH"})


class Door:
    """Middleware of all routes.

    Parameters
    ----------
    app : ASGI application
    max_bytes : int
        Largest size of a body [bytes].
    operations : sequence of APIRoute
        All operations, for the methods of an address.
    draining : asyncio.Event
        Set once the server stops: nothing more is received then.
    rounds : Rounds
        Order of the pieces of answers.
    guard : Guard, optional
        Keys of the service; all may pass if absent.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        max_bytes: int,
        operations: Sequence[APIRoute],
        draining: asyncio.Event,
        rounds: Rounds,
        guard: Guard | None = None,
    ) -> None:
        self._app, self._guard = app, guard
        self._draining, self._rounds = draining, rounds
        self._max_bytes = max_bytes
        self._operations = operations
        self._bodies = self._answers = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        CLIENT.set(client_of(scope))
        if self._guard is not None:
            try:
                _admit(self._guard, scope)
            except ServiceError as error:
                await response_of(scope["path"], error)(scope, receive, send)
                return
        if scope["type"] == "websocket":
            # Its messages are metered where they arrive: see `StreamProtocol`.
            await self._app(scope, receive, send)
            return
        answer = _Answer(scope, send, self._reserve, self._rounds)
        body = bytearray()
        try:
            refusal = self._options(scope)
            if refusal is None:
                await self._receive(scope, receive, body)
                await self._work(scope, bytes(body), receive, answer)
            else:
                await refusal(scope, receive, send)
        except ClientDisconnect:
            pass
        except HTTPException as error:
            await of_status(scope["path"], error.status_code, error.detail)(scope, receive, send)
        except ServiceError as error:
            await response_of(scope["path"], error)(scope, receive, send)
        finally:
            self._bodies -= _counted(len(body))
            self._answers -= answer.reserved

    def _options(self, scope: Scope) -> Response | None:
        """Return the answer to OPTIONS at an address that exists; load balancers check with it."""
        if scope["method"] != "OPTIONS":
            return None
        here = [one for one in self._operations if one.path_regex.match(scope["path"])]
        methods = {method for one in here for method in one.methods or ()}
        if scope["path"] == "/":
            methods.add("GET")
        if not methods:
            return None
        return Response(status_code=204, headers={"Allow": ", ".join(with_head(methods | {"OPTIONS"}))})

    async def _receive(self, scope: Scope, receive: Receive, body: bytearray) -> None:
        """Read a body within the limits.

        Raises
        ------
        HTTPException, FieldError, UnavailableError
            A limit is exceeded.
        UnsupportedFormatError
            The body is compressed or encoded otherwise.
        ClientDisconnect
            The client has gone.
        """
        most = self._max_bytes if scope["method"] in _WITH_BODY else _BODILESS_BYTES
        too_large = HTTPException(413, f"the body may have at most {most} bytes")
        headers = Headers(scope=scope)
        encodings = [one.strip().lower() for one in ",".join(headers.getlist("content-encoding")).split(",")]
        if set(encodings) - {"", "identity"}:
            raise UnsupportedFormatError(
                f"the body has the Content-Encoding {', '.join(encodings)}: send it as it is, without one"
            )
        declared = headers.get("content-length", "0")
        if not declared.isdecimal() or int(declared[:20]) > most:
            raise too_large
        values = Values("body") if is_json(headers) else None
        more = True
        while more:
            message = await (self._part(receive) if scope["method"] in _WITH_BODY else receive())
            if message["type"] == "http.disconnect":
                raise ClientDisconnect
            chunk, more = message.get("body", b""), message.get("more_body", False)
            self._bodies += _counted(len(body) + len(chunk)) - _counted(len(body))
            body += chunk
            if len(body) > most:
                raise too_large
            if self._bodies > MAX_BODIES_BYTES and _counted(len(body)):
                raise UnavailableError("other requests with large bodies take all memory: try again later")
            if values is not None:
                values.add(chunk)

    async def _part(self, receive: Receive) -> Message:
        """Return the next part of a body, unless the server stops."""

        async def part() -> Message:
            return await receive()

        receiving, stopping = asyncio.create_task(part()), asyncio.create_task(self._draining.wait())
        try:
            await asyncio.wait((receiving, stopping), return_when=asyncio.FIRST_COMPLETED)
            if receiving.done():
                return receiving.result()
            raise UnavailableError("the server is shutting down")
        finally:
            receiving.cancel()
            stopping.cancel()

    async def _work(self, scope: Scope, body: bytes, receive: Receive, answer: "_Answer") -> None:
        """Let the application answer, until it has done so or the client has gone."""
        left = asyncio.Event()
        given = False

        async def again() -> Message:
            nonlocal given
            if given:
                await left.wait()
                return {"type": "http.disconnect"}
            given = True
            return {"type": "http.request", "body": body, "more_body": False}

        async def watch() -> None:
            while (await receive())["type"] != "http.disconnect":
                pass
            left.set()

        inner = {**scope, "method": "GET"} if scope["method"] == "HEAD" else scope

        async def work() -> None:
            await self._app(inner, again, answer.send)

        working = asyncio.create_task(work())
        watching = asyncio.create_task(watch())
        answer.on_end = working.cancel
        try:
            await asyncio.wait((working, watching), return_when=asyncio.FIRST_COMPLETED)
            # A page that closes deletes its session, and waits for no answer.
            if not answer.complete and scope["method"] != "DELETE":
                working.cancel()
            await asyncio.wait((working,))
            if not working.cancelled():
                working.result()
        finally:
            await ended(working, watching)

    def _reserve(self, size: int) -> bool:
        """Count the memory of an answer; return whether there is room for it."""
        if self._answers and self._answers + size > MAX_ANSWERS_BYTES:
            return False
        self._answers += size
        return True


class _Answer:
    """One answer on its way to the client."""

    def __init__(self, scope: Scope, send: Send, reserve: Callable[[int], bool], rounds: Rounds) -> None:
        self._scope, self._send, self._reserve, self._rounds = scope, send, reserve, rounds
        self._start: Message | None = None
        self._begun = False
        self.reserved = 0
        """Memory that it takes [bytes]."""
        self.complete = False
        """Whether all of it was sent."""
        self.on_end: Callable[[], object] = lambda: None
        """Called where the rest of an answer is not needed."""

    async def send(self, message: Message) -> None:
        """Pass a message on, in pieces; the start of an answer waits for its body."""
        if message["type"] == "http.response.start":
            self._start = message
            return
        body, more = message.get("body", b""), message.get("more_body", False)
        if self._start is not None:
            size = 0 if more else _counted(len(body))
            if not self._reserve(size):
                self.complete = True
                error = UnavailableError("other large answers take all memory: try again later")
                await response_of(self._scope["path"], error)(self._scope, _nothing, self._send)
                return
            self.reserved = size
            await self._send(self._start)
            self._start = None
        if self._scope["method"] == "HEAD":
            await self._send({"type": "http.response.body", "body": b"", "more_body": False})
            self.complete = True
            if more:
                self.on_end()
            return
        for start in range(0, max(1, len(body)), _PIECE_BYTES):
            if self._begun:
                await self._rounds.turn(CLIENT.get())
            self._begun = True
            piece, rest = body[start : start + _PIECE_BYTES], start + _PIECE_BYTES < len(body)
            await self._send({"type": "http.response.body", "body": piece, "more_body": more or rest})
        self.complete = self.complete or not more


def _admit(guard: Guard, scope: Scope) -> None:
    """Let a request with a valid key pass; all connections of a key have one share of the work."""
    caller = guard.admit(scope)
    CALLER.set(caller)
    if caller.owner and caller.session is None:
        CLIENT.set(Client(f"key {caller.owner}", CLIENT.get().connection))


def client_of(scope: Scope) -> Client:
    """Return the client of a request: its address, in IPv6 its network, and its connection.

    Connections of an address that have sent no request before count as one.
    """
    host, port = scope.get("client") or ("", 0)
    if scope.get("state", {}).get(FIRST):
        port = 0
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return Client(host, port)
    if address.version == 6 and address.ipv4_mapped is None:
        # A host has 2^64 addresses.
        return Client(str(ipaddress.ip_network((int(address), 64), strict=False)), port)
    return Client(host, port)


def is_json(headers: Headers) -> bool:
    """Return whether headers announce a body of JSON."""
    media_type = headers.get("content-type", "").partition(";")[0].strip().lower()
    kind, _, subtype = media_type.partition("/")
    return kind == "application" and (subtype == "json" or subtype.endswith("+json"))


def with_head(methods: set[str]) -> list[str]:
    """Return methods in order, with HEAD where there is GET."""
    return sorted(methods | ({"HEAD"} if "GET" in methods else set()))


def _counted(size: int) -> int:
    """Return the size of a body or an answer for the limits on memory; small ones count as nothing."""
    return size if size > _PIECE_BYTES else 0


async def _nothing() -> Message:
    return {"type": "http.disconnect"}

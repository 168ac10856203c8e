"""Request handling of the routes of sessions and jobs: JSON, a stop of the server, `Idempotency-Key`."""

import asyncio
import hashlib
from collections import Counter
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute

from hybridmpm_service.errors import FieldError, IdempotencyKeyError, UnavailableError
from hybridmpm_service.http.door import is_json
from hybridmpm_service.http.problems import ended
from hybridmpm_service.http.requests import read_body
from hybridmpm_service.keys.callers import CALLER
from hybridmpm_service.sessions.turns import CLIENT, Client

HEADER = "Idempotency-Key"
_LONGEST_KEY = 200
_MOST = 1000
"""Largest number of keys that are kept. The oldest is forgotten first: of the address that has most, and of
its connection that has most."""
_LARGEST = 1 << 16
"""Largest answer that is kept [bytes]. Calls with larger ones change nothing: they are done again."""


@dataclass
class _Entry:
    client: Client
    digest: bytes
    answer: "asyncio.Future[Response | None]"
    """The answer; None if none is kept, so that the call is done again."""


class Idempotency:
    """The answers of requests that carried a key. Belongs to the event loop."""

    def __init__(self) -> None:
        self._entries: dict[tuple[str, str, str], _Entry] = {}

    async def once(self, request: Request, work: Callable[[], Awaitable[Response]]) -> Response:
        """Return the answer of a request with a key; do its work if it has not been done.

        Raises
        ------
        FieldError
            The key is empty, or too long.
        IdempotencyKeyError
            The key came with another request before.
        """
        key = request.headers[HEADER].strip()
        if not 0 < len(key) <= _LONGEST_KEY:
            raise FieldError(f"header.{HEADER}", f"must have 1 to {_LONGEST_KEY} characters, got {len(key)}")
        place = (CALLER.get().name, request.url.path, key)
        digest = await _digest(request)
        while (entry := self._entries.get(place)) is not None:
            if entry.digest != digest:
                raise IdempotencyKeyError(
                    f"the {HEADER} {key!r} came with another request to this address: take a new one"
                )
            answer = await asyncio.shield(entry.answer)
            if answer is not None:
                return _copied(answer)
        entry = _Entry(CLIENT.get(), digest, asyncio.get_running_loop().create_future())
        self._entries[place] = entry
        if len(self._entries) > _MOST:
            self._forget()
        kept = None
        try:
            answer = await work()
            # A fault may be gone next time, and a stream cannot be kept.
            body = getattr(answer, "body", None)
            if answer.status_code < 500 and body is not None and len(body) <= _LARGEST:
                kept = answer
            return answer
        finally:
            if kept is None:
                self._entries.pop(place, None)
            entry.answer.set_result(kept)

    def _forget(self) -> None:
        """Forget the oldest key of the client that has most."""
        clients = [entry.client for entry in self._entries.values()]
        address = Counter(one.address for one in clients).most_common(1)[0][0]
        ((client, _),) = Counter(one for one in clients if one.address == address).most_common(1)
        del self._entries[next(place for place, entry in self._entries.items() if entry.client == client)]


async def _digest(request: Request) -> bytes:
    parts = [request.url.query, *(request.headers.get(name, "") for name in ("accept", "prefer"))]
    head = "\n".join(parts).encode()
    return hashlib.sha256(head + b"\n" + await request.body()).digest()


def _copied(answer: Response) -> Response:
    twin = Response(answer.body, answer.status_code)
    twin.raw_headers = list(answer.raw_headers)
    return twin


Handler = Callable[[Request], Coroutine[Any, Any, Response]]


class SessionRoute(APIRoute):
    """A route whose calls are refused when the server stops; a body of JSON is read within limits.

    A POST with an `Idempotency-Key` that came before gets the same answer again. Everything else that guards
    a call is at the `Door`, which all routes have.
    """

    def get_route_handler(self) -> Handler:
        """Return the handler of a request."""
        handle = super().get_route_handler()
        # Routes without a model read their bodies themselves.
        takes_model = self.body_field is not None

        async def call(request: Request) -> Response:
            body = await request.body()
            if takes_model and body and is_json(request.headers):
                value = await read_body(request.app.state.sessions.turns, body)
                request = _ReadRequest(request, body, value)
            return await handle(request)

        async def once(request: Request) -> Response:
            if request.method != "POST" or HEADER not in request.headers:
                return await call(request)
            kept: Idempotency = request.app.state.idempotency
            return await kept.once(request, lambda: call(request))

        async def answer(request: Request) -> Response:
            if request.method == "DELETE":
                return await handle(request)
            draining: asyncio.Event = request.app.state.sessions.draining
            response = await _unless(draining.wait(), once(request))
            if response is None:
                raise UnavailableError("the server is shutting down")
            return response

        return answer


class _ReadRequest(Request):
    """A request whose body has been read and parsed."""

    def __init__(self, request: Request, body: bytes, value: Any) -> None:
        super().__init__(request.scope, request.receive)
        self._read, self._value = body, value

    async def body(self) -> bytes:
        """Return the body."""
        return self._read

    async def json(self) -> Any:
        """Return the value of the body."""
        return self._value


async def _unless(end: Awaitable[object], work: Coroutine[Any, Any, Response]) -> Response | None:
    """Return the result of the work; None if the end came first, which cancels the work."""
    working, ending = asyncio.create_task(work), asyncio.ensure_future(end)
    try:
        await asyncio.wait((working, ending), return_when=asyncio.FIRST_COMPLETED)
        return None if ending.done() else working.result()
    finally:
        await ended(working, ending)

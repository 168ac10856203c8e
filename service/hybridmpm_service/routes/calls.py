"""Request handling shared by all routes: limits on JSON, cancellation, and `Idempotency-Key`."""

import asyncio
import hashlib
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.requests import ClientDisconnect

from hybridmpm_service.errors import FieldError, IdempotencyKeyError, UnavailableError
from hybridmpm_service.http.requests import read_json

HEADER = "Idempotency-Key"
_LONGEST_KEY = 200
_MOST = 1000
"""Largest number of keys that are kept; the oldest is forgotten first."""
_LARGEST = 1 << 16
"""Largest answer that is kept [bytes]. Calls with larger ones change nothing: they are done again."""


@dataclass
class _Entry:
    digest: bytes
    answer: "asyncio.Future[Response | None]"
    """The answer; None if none is kept, so that the call is done again."""


class Idempotency:
    """The answers of requests that carried a key. Belongs to the event loop."""

    def __init__(self) -> None:
        self._entries: OrderedDict[tuple[str, str], _Entry] = OrderedDict()

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
        place = (request.url.path, key)
        digest = await _digest(request)
        while (entry := self._entries.get(place)) is not None:
            if entry.digest != digest:
                raise IdempotencyKeyError(
                    f"the {HEADER} {key!r} came with another request to this address: take a new one"
                )
            answer = await asyncio.shield(entry.answer)
            if answer is not None:
                return _copied(answer)
        entry = _Entry(digest, asyncio.get_running_loop().create_future())
        self._entries[place] = entry
        if len(self._entries) > _MOST:
            self._entries.popitem(last=False)
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
    """A route whose calls are cancelled when their client has gone, and refused when the server stops.

    A POST with an `Idempotency-Key` that came before gets the same answer again. A DELETE is done in any
    case: a closing page sends one, and waits for no answer.
    """

    def get_route_handler(self) -> Handler:
        """Return the handler of a request."""
        handle = super().get_route_handler()
        # Routes without a model read their bodies themselves.
        takes_model = self.body_field is not None

        async def call(request: Request) -> Response:
            if request.method == "DELETE":
                return await handle(request)
            body = await request.body()
            if takes_model and body and _is_json(request):
                # FastAPI parses the body once more, within these limits.
                await asyncio.to_thread(read_json, body, "body")
            return await _unless(_left(request), handle(request)) or _no_answer()

        async def once(request: Request) -> Response:
            if request.method != "POST" or HEADER not in request.headers:
                return await call(request)
            kept: Idempotency = request.app.state.idempotency
            return await kept.once(request, lambda: call(request))

        async def answer(request: Request) -> Response:
            draining: asyncio.Event = request.app.state.sessions.draining
            try:
                response = await _unless(draining.wait(), once(request))
            except ClientDisconnect:
                return _no_answer()
            if response is None:
                raise UnavailableError("the server is shutting down")
            return response

        return answer


async def _unless(end: Awaitable[object], work: Coroutine[Any, Any, Response]) -> Response | None:
    """Return the result of the work; None if the end came first, which cancels the work."""
    working, ending = asyncio.create_task(work), asyncio.ensure_future(end)
    try:
        await asyncio.wait((working, ending), return_when=asyncio.FIRST_COMPLETED)
        return None if ending.done() else working.result()
    finally:
        for task in (working, ending):
            task.cancel()
        await asyncio.gather(working, ending, return_exceptions=True)


async def _left(request: Request) -> None:
    """Wait until the client of a request that has been read has gone."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def _no_answer() -> Response:
    """Return an answer for a client that has gone."""
    return Response(status_code=204)


def _is_json(request: Request) -> bool:
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    kind, _, subtype = media_type.partition("/")
    return kind == "application" and (subtype == "json" or subtype.endswith("+json"))

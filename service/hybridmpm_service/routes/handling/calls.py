"""What all calls of sessions have in common: a bounded body, and an end with the client or the server."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.requests import ClientDisconnect

from hybridmpm_service.errors import UnavailableError
from hybridmpm_service.http.json_text import read_json
from hybridmpm_service.routes.handling.idempotency import HEADER, Idempotency

Handler = Callable[[Request], Coroutine[Any, Any, Response]]


class SessionRoute(APIRoute):
    """A route whose calls are cancelled when their client has gone, and refused when the server stops.

    A POST with an `Idempotency-Key` that came before is answered as it was then.
    A DELETE is done in any case: a page that is left sends one, and waits for no answer.
    """

    def get_route_handler(self) -> Handler:
        """Return the function that answers a request."""
        handle = super().get_route_handler()
        # Routes without a model read their bodies themselves.
        takes_model = self.body_field is not None

        async def call(request: Request) -> Response:
            if request.method == "DELETE":
                return await handle(request)
            body = await request.body()
            if takes_model and body and _is_json(request):
                # FastAPI parses the body once more; it is known to be harmless then.
                await asyncio.to_thread(read_json, body, "body")
            return await _unless(_left(request), handle(request)) or _answer_to_nobody()

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
                return _answer_to_nobody()
            if response is None:
                raise UnavailableError("the server is shutting down")
            return response

        return answer


async def _unless(end: Awaitable[object], work: Coroutine[Any, Any, Response]) -> Response | None:
    """Return what the work returns; None if the end came before, when the work has been cancelled."""
    working, ending = asyncio.create_task(work), asyncio.ensure_future(end)
    try:
        await asyncio.wait((working, ending), return_when=asyncio.FIRST_COMPLETED)
        return None if ending.done() else working.result()
    finally:
        for task in (working, ending):
            task.cancel()
        await asyncio.gather(working, ending, return_exceptions=True)


async def _left(request: Request) -> None:
    """Wait until the client has gone; the body has been read."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def _answer_to_nobody() -> Response:
    """Return an answer whose reader has gone."""
    return Response(status_code=204)


def _is_json(request: Request) -> bool:
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    kind, _, subtype = media_type.partition("/")
    return kind == "application" and (subtype == "json" or subtype.endswith("+json"))

"""Requests that are sent again: with the same `Idempotency-Key` they act once."""

import asyncio
import hashlib
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from fastapi import Request, Response

from hybridmpm_service.errors import FieldError, IdempotencyKeyError

HEADER = "Idempotency-Key"
_LONGEST_KEY = 200
_MOST = 1000
"""Largest number of keys that are kept; the oldest is forgotten first."""
_LARGEST = 1 << 16
"""Largest answer that is kept [bytes]. Larger ones are of calls that change nothing: they are done again."""


@dataclass
class _Entry:
    digest: bytes
    answer: "asyncio.Future[Response | None]"
    """The answer; None if there is none to be kept, so that the call has to be done again."""


class Idempotency:
    """The answers of requests that carried a key. Belongs to the event loop."""

    def __init__(self) -> None:
        self._entries: OrderedDict[tuple[str, str], _Entry] = OrderedDict()

    async def once(self, request: Request, work: Callable[[], Awaitable[Response]]) -> Response:
        """Return the answer of a request with a key, by doing its work if it has not been done.

        Raises
        ------
        FieldError
            The key is empty, or too long.
        IdempotencyKeyError
            It came with another request before.
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
            # A fault may be gone next time, and of a stream nothing is left.
            body = getattr(answer, "body", None)
            if answer.status_code < 500 and body is not None and len(body) <= _LARGEST:
                kept = answer
            return answer
        finally:
            if kept is None:
                self._entries.pop(place, None)
            entry.answer.set_result(kept)


async def _digest(request: Request) -> bytes:
    told = [request.url.query, *(request.headers.get(name, "") for name in ("accept", "prefer"))]
    head = "\n".join(told).encode()
    return hashlib.sha256(head + b"\n" + await request.body()).digest()


def _copied(answer: Response) -> Response:
    twin = Response(answer.body, answer.status_code)
    twin.raw_headers = list(answer.raw_headers)
    return twin

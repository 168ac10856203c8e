"""uvicorn's protocols, with deadlines for clients that send or read too slowly.

They subclass private classes of uvicorn, because its public settings have no deadline for the head and body
of a request, none for a stream whose client does not read, and no limit that also counts silent connections.
A proxy in front would close these holes only for those who run one. Tests of slow clients guard the
overrides.
"""

import asyncio
from http import HTTPStatus
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from hybridmpm_service.http.problems import RETRY_AFTER_SECONDS, of_status

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

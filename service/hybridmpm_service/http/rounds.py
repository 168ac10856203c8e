"""Order in which the event loop does what clients make it do: reading requests, sending large answers.

A crowd of connections would keep the loop busy for long with one round of all of them, and everything else
waiting for that: frames, timers, the other steps of a call. So each round of the loop does a piece, in
turn between addresses, then between their connections that are new and those that have sent a request before,
and then between these: whoever opens a connection for each call waits behind its own calls, and not before
those of others.
"""

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any

from hybridmpm_service.sessions.turns import Client

_AT_ONCE = 1
"""Pieces of a round; one takes up to a millisecond. With more, the steps of other calls wait longer."""


class Rounds:
    """Pieces of work that wait for a round of the event loop. Belongs to the event loop."""

    def __init__(self) -> None:
        self._waiting: dict[str, dict[bool, dict[int, deque[Callable[[], object]]]]] = {}
        self._left = _AT_ONCE
        self._handle: asyncio.Handle | None = None

    def do(self, client: Client, work: Callable[[], object]) -> bool:
        """Do a piece of work, now or in a later round; return whether it has been done.

        Work of one client is done in the order in which it came.
        """
        if not self._waiting and self._left:
            self._left -= 1
            self._schedule()
            work()
            return True
        kinds = self._waiting.setdefault(client.address, {})
        connections = kinds.setdefault(client.connection == 0, {})
        connections.setdefault(client.connection, deque()).append(work)
        self._schedule()
        return False

    async def turn(self, client: Client) -> None:
        """Wait for a round in which a client may go on."""
        may_go_on = asyncio.Event()
        self.do(client, may_go_on.set)
        await may_go_on.wait()

    def _schedule(self) -> None:
        if self._handle is None:
            self._handle = asyncio.get_running_loop().call_soon(self._round)

    def _round(self) -> None:
        """Do the pieces of a round; an exception of one ends the round alone."""
        self._handle, self._left = None, _AT_ONCE
        if self._waiting:
            self._schedule()
        while self._waiting and self._left:
            self._left -= 1
            self._next()()

    def _next(self) -> Callable[[], object]:
        """Return the first piece of the client whose turn it is; its next turn comes after all others."""
        kinds = _rotated(self._waiting)
        connections = _rotated(kinds)
        pieces = _rotated(connections)
        work: Callable[[], object] = pieces.popleft()
        for inner, outer in ((pieces, connections), (connections, kinds), (kinds, self._waiting)):
            if not inner:
                outer.popitem()
        return work


def _rotated(queues: dict[Any, Any]) -> Any:
    """Move the first item of a dictionary to the end, and return its value."""
    key = next(iter(queues))
    queues[key] = found = queues.pop(key)
    return found

"""What waits for one client: the newest frame, word that the status changed, and the last problems."""

import asyncio
from collections import deque
from enum import Enum
from typing import TypeAlias

MAX_PROBLEMS = 16
"""Of these the oldest goes first: a client that never reads must not fill the memory."""


class Signal(Enum):
    """A message without content of its own: the sender looks it up, so that it is never stale."""

    STATUS = "status"


Message: TypeAlias = bytes | Signal | Exception
"""A binary frame, the wish for a status, or an error to tell."""


class MailboxClosed(Exception):  # noqa: N818 - the end of a stream, not a fault
    """No more messages will come.

    Parameters
    ----------
    code : int
        WebSocket close code.
    reason : str
    """

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


class Mailbox:
    """Belongs to the event loop. Putting never waits, so a slow client delays nobody."""

    def __init__(self) -> None:
        self._problems: deque[Exception] = deque(maxlen=MAX_PROBLEMS)
        self._status = False
        self._frame: bytes | None = None
        self._end: asyncio.Future[MailboxClosed] = asyncio.get_running_loop().create_future()
        self._changed = asyncio.Event()

    def put_frame(self, frame: bytes) -> None:
        """Replace the frame that waits."""
        self._frame = frame
        self._changed.set()

    def put_status(self) -> None:
        """Ask for a status message; several wishes are one."""
        self._status = True
        self._changed.set()

    def put_problem(self, problem: Exception) -> None:
        """Add an error to tell."""
        self._problems.append(problem)
        self._changed.set()

    def close(self, code: int, reason: str) -> None:
        """End the stream; a second call changes nothing."""
        if not self._end.done():
            self._end.set_result(MailboxClosed(code, reason))
        self._changed.set()

    async def closed(self) -> MailboxClosed:
        """Wait until `close`."""
        return await asyncio.shield(self._end)

    async def take(self) -> Message:
        """Wait for the next message: problems first, then the status, then the frame.

        Raises
        ------
        MailboxClosed
            After `close`; what waited is dropped.
        """
        while True:
            if self._end.done():
                raise self._end.result()
            if self._problems:
                return self._problems.popleft()
            if self._status:
                self._status = False
                return Signal.STATUS
            if self._frame is not None:
                frame, self._frame = self._frame, None
                return frame
            self._changed.clear()
            await self._changed.wait()

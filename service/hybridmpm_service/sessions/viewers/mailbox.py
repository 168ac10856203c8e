"""Messages that wait for one client: the newest frame, a request for the status, the latest problems."""

import asyncio
from collections import deque
from enum import Enum
from typing import TypeAlias

from hybridmpm.stream_frames import FrameMessage

MAX_PROBLEMS = 16
"""Largest number of problems that wait; a further one drops the oldest.

A client that never reads must not fill the memory.
"""


class Signal(Enum):
    """A message without content. The sender looks the content up when it sends, so that it is never stale."""

    STATUS = "status"


Message: TypeAlias = FrameMessage | Signal | Exception
"""A frame, a request for the status, or an error that the client has to know."""


class MailboxClosed(Exception):  # noqa: N818 - the end of a stream, not a fault
    """No more messages will come.

    Parameters
    ----------
    code : int
        WebSocket close code.
    reason : str
        Why the stream ends, for the client.
    """

    def __init__(self, code: int, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


class Mailbox:
    """Messages on their way to one client. Putting never waits, so a slow client delays no other.

    A mailbox belongs to the event loop.
    """

    def __init__(self) -> None:
        self._problems: deque[Exception] = deque(maxlen=MAX_PROBLEMS)
        self._status = False
        self._frame: FrameMessage | None = None
        self._end: asyncio.Future[MailboxClosed] = asyncio.get_running_loop().create_future()
        self._changed = asyncio.Event()

    def put_frame(self, frame: FrameMessage) -> None:
        """Put a frame in, in the place of one that still waits."""
        self._frame = frame
        self._changed.set()

    def put_status(self) -> None:
        """Ask for a status message; several requests become one message."""
        self._status = True
        self._changed.set()

    def put_problem(self, problem: Exception) -> None:
        """Put in an error that the client has to know."""
        self._problems.append(problem)
        self._changed.set()

    def close(self, code: int, reason: str) -> None:
        """End the stream; a second call changes nothing."""
        if not self._end.done():
            self._end.set_result(MailboxClosed(code, reason))
        self._changed.set()

    async def closed(self) -> MailboxClosed:
        """Wait until the mailbox is closed, and return how."""
        return await asyncio.shield(self._end)

    async def take(self) -> Message:
        """Wait for the next message and take it out: problems first, then the status, then the frame.

        Raises
        ------
        MailboxClosed
            The mailbox has been closed; messages that waited are dropped.
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

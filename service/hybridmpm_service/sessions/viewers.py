"""Viewers of a session: a mailbox for each, and messages that are made once for all."""

import asyncio
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import TypeAlias

from hybridmpm.stream_frames import FrameMessage

MAX_PROBLEMS = 16
"""Largest number of problems that wait; a further one drops the oldest.

They are bounded because some clients never read.
"""


class Signal(Enum):
    """A message without content, which is looked up at the time of sending, so that it is never stale."""

    STATUS = "status"


Message: TypeAlias = FrameMessage | Signal | Exception | str
"""A frame, a request for the status, an error for the client, or a text for it alone."""


class MailboxClosed(Exception):  # noqa: N818 - the end of a stream, not a fault
    """No more messages will come.

    Parameters
    ----------
    code : int
        WebSocket close code.
    reason : str
        Reason for the client.
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
        self._texts: deque[str] = deque(maxlen=MAX_PROBLEMS)
        self._status = False
        self._frame: FrameMessage | None = None
        self._end: asyncio.Future[MailboxClosed] = asyncio.get_running_loop().create_future()
        self._changed = asyncio.Event()

    def put_frame(self, frame: FrameMessage) -> None:
        """Put in a frame, which replaces one that still waits."""
        self._frame = frame
        self._changed.set()

    def put_status(self) -> None:
        """Request a status message; several requests become one message."""
        self._status = True
        self._changed.set()

    def put_problem(self, problem: Exception) -> None:
        """Put in an error for the client."""
        self._problems.append(problem)
        self._changed.set()

    def put_text(self, text: str) -> None:
        """Put in a text for this client alone."""
        self._texts.append(text)
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
        """Wait for the next message and take it out: problems first, then texts, the status, the frame.

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
            if self._texts:
                return self._texts.popleft()
            if self._status:
                self._status = False
                return Signal.STATUS
            if self._frame is not None:
                frame, self._frame = self._frame, None
                return frame
            self._changed.clear()
            await self._changed.wait()


class Audience:
    """The mailboxes of the viewers of one session. Belongs to the event loop."""

    def __init__(self) -> None:
        self._mailboxes: set[Mailbox] = set()
        self._status: str | None = None

    def __len__(self) -> int:
        """Return the number of viewers."""
        return len(self._mailboxes)

    def join(self) -> Mailbox:
        """Return the mailbox of a new viewer."""
        mailbox = Mailbox()
        self._mailboxes.add(mailbox)
        return mailbox

    def leave(self, mailbox: Mailbox) -> None:
        """Remove the mailbox of a viewer."""
        self._mailboxes.discard(mailbox)

    def post_frame(self, frame: FrameMessage, but: Mailbox | None = None) -> None:
        """Send a frame to all but one."""
        for mailbox in self._mailboxes:
            if mailbox is not but:
                mailbox.put_frame(frame)

    def post_problem(self, problem: Exception) -> None:
        """Send a problem to all."""
        for mailbox in self._mailboxes:
            mailbox.put_problem(problem)

    def post_status(self) -> None:
        """Send the status to all, made when the first of them takes it."""
        self._status = None
        for mailbox in self._mailboxes:
            mailbox.put_status()

    def status(self, make: Callable[[], str]) -> str:
        """Return the text of the posted status, by `make` for the first viewer that takes it."""
        if self._status is None:
            self._status = make()
        return self._status

    def close(self, code: int, reason: str) -> None:
        """Close all streams with a WebSocket close code."""
        for mailbox in self._mailboxes:
            mailbox.close(code, reason)

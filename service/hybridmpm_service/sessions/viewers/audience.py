"""All viewers of a session: what is sent to them is made once."""

from collections.abc import Callable

from hybridmpm.stream_frames import FrameMessage
from hybridmpm_service.sessions.viewers.mailbox import Mailbox


class Audience:
    """The mailboxes of the viewers of one session. Belongs to the event loop."""

    def __init__(self) -> None:
        self._mailboxes: set[Mailbox] = set()
        self._status: str | None = None

    def __bool__(self) -> bool:
        """Whether there is a viewer."""
        return bool(self._mailboxes)

    def join(self) -> Mailbox:
        """Return the mailbox of a new viewer."""
        mailbox = Mailbox()
        self._mailboxes.add(mailbox)
        return mailbox

    def leave(self, mailbox: Mailbox) -> None:
        """Send a viewer nothing any more."""
        self._mailboxes.discard(mailbox)

    def post_frame(self, frame: FrameMessage) -> None:
        """Send a frame to all."""
        for mailbox in self._mailboxes:
            mailbox.put_frame(frame)

    def post_problem(self, problem: Exception) -> None:
        """Send a problem to all."""
        for mailbox in self._mailboxes:
            mailbox.put_problem(problem)

    def post_status(self) -> None:
        """Send the status to all, as it is when the first of them gets it."""
        self._status = None
        for mailbox in self._mailboxes:
            mailbox.put_status()

    def status(self, make: Callable[[], str]) -> str:
        """Return the text of the posted status, which `make` returns if nobody has got it yet."""
        if self._status is None:
            self._status = make()
        return self._status

    def close(self, code: int, reason: str) -> None:
        """Close all streams with a WebSocket close code."""
        for mailbox in self._mailboxes:
            mailbox.close(code, reason)

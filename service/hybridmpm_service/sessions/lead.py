"""The lead of a session: a viewer's tab computes its frames first, the session computes the same later."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hybridmpm.control import Pull, Push
from hybridmpm_service.errors import FieldError
from hybridmpm_service.sessions.inputs import Grip, HandInput, hand_record
from hybridmpm_service.sessions.viewers import Mailbox

MAX_AHEAD = 400
"""Largest number of frames that a tab may be ahead of the session, which computes them before any answer."""
SILENT_SECONDS = 2.0
"""Time without a message of the tab after which the session goes on alone [s]."""


@dataclass(eq=False)
class Lead:
    """A tab that leads. Belongs to the event loop."""

    by: Mailbox
    """Mailbox of the viewer."""
    upto: int | None = None
    """Latest frame of the tab; None before it has the state to begin with."""
    silent: int = 0
    """Number of statuses since its latest message."""
    ends: bool = False
    """Whether the tab has asked for the end, and the session computes the frames up to it."""

    def check(self, upto: int, inputs: Sequence[HandInput], computed: int) -> None:
        """Check a message of the tab.

        Parameters
        ----------
        upto : int
            Latest frame of the tab.
        inputs : sequence of PushInput and PullInput
            Inputs of its frames.
        computed : int
            Latest frame of the session.

        Raises
        ------
        FieldError
            Frames are not in order, or too far ahead.
        """
        first = self.upto or 0
        if not first <= upto <= computed + MAX_AHEAD:
            allowed = f"must be in [{first}, {computed + MAX_AHEAD}]"
            raise FieldError("upto", f"{allowed}, got {upto}: wait until the session follows")
        for place, one in enumerate(inputs):
            if not first <= one.frame <= upto:
                raise FieldError(f"inputs[{place}].frame", f"must be in [{first}, {upto}], got {one.frame}")
            first = one.frame


def note(kind: str, **content: Any) -> str:
    """Return a message to a tab that leads."""
    return json.dumps({"type": kind} | content, separators=(",", ":"))


def hand_of(force: Push | Pull | None) -> dict[str, Any]:
    """Return a hand's force as plain data: of a push and a pull one is null, or both."""
    record = hand_record(force)
    plain = None if record is None else record.model_dump()
    return {"push": None, "pull": plain} if isinstance(record, Grip) else {"push": plain, "pull": None}

"""Messages of a stream: commands, frames and statuses."""

import json
from typing import Any, TypeAlias

from hybridmpm.client.errors import ServiceError
from hybridmpm.stream_frames import Frame, decode

Message: TypeAlias = Frame | dict[str, Any]
"""A frame, or a status of the session."""
VERSION = 3
"""Version of the frames that the client requests."""


def read(message: str | bytes, length: float = 1.0) -> Message:
    """Return a message of the service; frames are of a world whose longest side is `length` [m].

    Raises
    ------
    ServiceError
        The service refuses a command, or a frame has failed.
    """
    if isinstance(message, bytes):
        return decode(message, length)
    status: dict[str, Any] = json.loads(message)
    if status["type"] == "problem":
        raise ServiceError(status | {"type": status["problem"]})
    return status


def event(line: str) -> dict[str, Any] | None:
    """Return the description of a job in a line of server-sent events; None for any other line."""
    info: dict[str, Any] | None = json.loads(line[5:]) if line.startswith("data:") else None
    return info


def command(kind: str, **values: Any) -> str:
    """Return a command of the player."""
    return json.dumps({"type": kind} | {name: value for name, value in values.items() if value is not None})


def socket_address(address: str, session_id: str) -> str:
    """Return the address of a session's stream."""
    scheme, _, rest = address.rstrip("/").partition("://")
    return (
        f"{'wss' if scheme == 'https' else 'ws'}://{rest}/v1/sessions/{session_id}/stream?version={VERSION}"
    )

"""Messages of a stream: commands as they are sent, and what comes back."""

import json
from collections.abc import Sequence
from typing import Any, TypeAlias

from hybridmpm.client.errors import ServiceError
from hybridmpm.stream_frames import Frame, decode

Message: TypeAlias = Frame | dict[str, Any]
"""A frame, or a status of the session."""
VERSION = 2
"""Version of the frames that are asked for."""


def read(message: str | bytes) -> Message:
    """Return what the service sent.

    Raises
    ------
    ServiceError
        It refuses a command, or a frame has failed.
    """
    if isinstance(message, bytes):
        return decode(message)
    told: dict[str, Any] = json.loads(message)
    if told["type"] == "problem":
        raise ServiceError(told | {"type": told["problem"]})
    return told


def event(line: str) -> dict[str, Any] | None:
    """Return the job that a line of server-sent events tells of; None for any other line."""
    told: dict[str, Any] | None = json.loads(line[5:]) if line.startswith("data:") else None
    return told


def command(kind: str, **values: Any) -> str:
    """Return a command of the player."""
    return json.dumps({"type": kind} | {name: value for name, value in values.items() if value is not None})


def push(point: Sequence[float], velocity: Sequence[float], radius: float, cap: float | None) -> str:
    """Return the command of a hand that pushes."""
    return command("push", point=list(point), velocity=list(velocity), radius=radius, cap=cap)


def socket_address(address: str, session_id: str) -> str:
    """Return the address of a session's stream."""
    scheme, _, rest = address.rstrip("/").partition("://")
    return (
        f"{'wss' if scheme == 'https' else 'ws'}://{rest}/v1/sessions/{session_id}/stream?version={VERSION}"
    )

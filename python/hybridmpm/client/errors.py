"""What a service refuses, and what keeps a client from reaching it."""

from collections.abc import Mapping
from typing import Any

import httpx

from hybridmpm.errors import SimulationError

_KIND = "urn:hybridmpm:problem:"


class UnreachableError(SimulationError):
    """No service answers at the address, or not in time."""


class StreamClosedError(SimulationError):
    """The service has ended a stream.

    Parameters
    ----------
    message : str
    code : int
        Why: 4404 the session is gone, 4406 its frames cannot be had, 1001 the service stops, 1008 too many
        messages, 1009 a message too large, 1006 the connection broke.
    """

    code: int

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class ServiceError(SimulationError):
    """The service refuses a call or a command, by RFC 9457.

    Parameters
    ----------
    problem : mapping
        The problem as the service tells it; its `detail` says what is wrong and what to change.
    retry_after : float, optional
        Seconds after which the call may succeed.
    """

    status: int
    """HTTP status."""
    kind: str
    """Name of the kind of problem, as "session-not-found"."""
    fields: list[tuple[str, str]]
    """Path of each field of the request that is not allowed, and what is allowed."""
    retry_after: float | None

    def __init__(self, problem: Mapping[str, Any], retry_after: float | None = None) -> None:
        fields = [(str(one["field"]), str(one["message"])) for one in problem.get("errors") or ()]
        named = "; ".join(f"{field}: {text}" for field, text in fields)
        super().__init__(f"{problem['detail']}{f' ({named})' if named else ''}")
        self.status = int(problem["status"])
        self.kind = str(problem["type"]).removeprefix(_KIND)
        self.fields = fields
        self.retry_after = retry_after


def refusal(answer: httpx.Response) -> ServiceError:
    """Return the error that an answer tells of; one that is no problem of the service stands for itself."""
    after = answer.headers.get("Retry-After", "")
    wait = float(after) if after.isdigit() else None
    try:
        return ServiceError(answer.json(), wait)
    except (ValueError, KeyError, TypeError):
        told = {
            "type": "about:blank",
            "status": answer.status_code,
            "detail": f"{answer.request.url} answers {answer.status_code}, and is no service of hybridmpm",
        }
        return ServiceError(told, wait)


def unreachable(address: str, error: Exception) -> UnreachableError:
    """Return the error for a service that does not answer."""
    if isinstance(error, httpx.TimeoutException | TimeoutError):
        return UnreachableError(f"the service at {address} has not answered in time: raise `timeout`")
    return UnreachableError(f"no service answers at {address} ({error}): start one with `hybridmpm serve`")

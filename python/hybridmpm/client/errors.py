"""Errors of calls: the service refuses, does not answer, or has ended a stream."""

import json
from collections.abc import Mapping
from typing import Any

import httpx
from websockets.exceptions import ConnectionClosed, InvalidStatus

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
        Reason: 4401 the key is not valid any more, 4404 the session is gone, 4406 its frames cannot be had,
        1001 the service stops, 1008 too many messages, 1009 a message too large, 1006 the connection broke.
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
        The body of the answer; its `detail` says what is wrong and what to change.
    retry_after : float, optional
        Seconds after which the call may succeed.
    """

    status: int
    """HTTP status."""
    kind: str
    """Name of the kind of problem, as "session-not-found"."""
    fields: list[tuple[str, str]]
    """Path of each invalid field of the request, and the values that are allowed."""
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
    """Return the error of an answer, also where it is not the answer of a hybridmpm service."""
    after = answer.headers.get("Retry-After", "")
    wait = float(after) if after.isdigit() else None
    try:
        return ServiceError(answer.json(), wait)
    except (ValueError, KeyError, TypeError):
        problem = {
            "type": "about:blank",
            "status": answer.status_code,
            "detail": f"{answer.request.url} answers {answer.status_code}, and is no service of hybridmpm",
        }
        return ServiceError(problem, wait)


def refused_stream(address: str, error: InvalidStatus) -> SimulationError:
    """Return the error of a stream that the service has not opened, with its reason if it gives one."""
    try:
        return ServiceError(json.loads(error.response.body or b""))
    except (ValueError, KeyError, TypeError):
        return unreachable(address, error)


def unreachable(address: str, error: Exception) -> UnreachableError:
    """Return the error for a service that does not answer."""
    if isinstance(error, httpx.TimeoutException | TimeoutError):
        return UnreachableError(f"the service at {address} has not answered in time: raise `timeout`")
    return UnreachableError(f"no service answers at {address} ({error}): start one with `hybridmpm serve`")


def closed(error: ConnectionClosed) -> StreamClosedError:
    """Return the error of a stream that the service has ended."""
    code = 1006 if error.rcvd is None else error.rcvd.code
    reason = "" if error.rcvd is None else error.rcvd.reason
    return StreamClosedError(
        f"the service has ended the stream with code {code}: {reason or 'no reason'}", code
    )

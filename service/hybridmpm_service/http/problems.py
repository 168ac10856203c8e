"""Problems: every answer that is not a success, as `application/problem+json` (RFC 9457)."""

import asyncio
import json
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any, NamedTuple

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from hybridmpm.errors import SceneError, SimulationError, SketchError
from hybridmpm_service.errors import (
    FieldError,
    IdempotencyKeyError,
    JobLostError,
    JobNotFoundError,
    JobUnfinishedError,
    KeyInAddressError,
    KeyRefusedError,
    LeadRefusedError,
    MachineFullError,
    ModelDamagedError,
    OtherNodeError,
    PressureUnknownError,
    QuotaError,
    ScenarioNotFoundError,
    ScopeError,
    ServiceError,
    SessionBusyError,
    SessionNotFoundError,
    SketchDroppedError,
    StorageError,
    TooManyJobsError,
    TooManySessionsError,
    UnavailableError,
    UnsupportedFormatError,
    UploadTooLargeError,
    WorkTooLongError,
    field_path,
)

MEDIA_TYPE = "application/problem+json"
RETRY_AFTER_SECONDS = 10
_HEADERS = {401: {"WWW-Authenticate": "Bearer"}, 503: {"Retry-After": str(RETRY_AFTER_SECONDS)}}
MAX_ERRORS = 20
"""Largest number of fields that an answer names."""
MAX_DETAIL = 1000
"""Largest length of a problem's detail [characters]."""
_MAX_FIELD, _MAX_MESSAGE, _MAX_INSTANCE = 120, 320, 200
"""Largest lengths of other texts [characters]. One takes at most six bytes, so an answer is below 64 KB."""


class FieldProblem(BaseModel, use_attribute_docstrings=True):
    """A field of the request whose value is not allowed."""

    field: str = Field(examples=["body.seed"])
    """Path of the field."""
    message: str = Field(examples=["Input should be greater than or equal to 0"])
    """What is wrong with its value."""


class Problem(BaseModel, use_attribute_docstrings=True):
    """An answer that is not a success, by RFC 9457."""

    type: str = Field(examples=["urn:hybridmpm:problem:session-not-found"])
    """Name of the kind of problem."""
    title: str = Field(examples=["Unknown session"])
    """Title of the kind of problem."""
    status: int = Field(examples=[404])
    """HTTP status."""
    detail: str = Field(examples=["there is no session 'abc'; it may have been deleted or have expired"])
    """What went wrong this time, and what to change."""
    instance: str = Field(examples=["/v1/sessions/abc"])
    """Path of the request."""
    errors: list[FieldProblem] | None = None
    """Fields whose values are not allowed, where the problem is about fields."""


class Row(NamedTuple):
    """HTTP answer to a class of exceptions: status, name of the kind of problem, title."""

    status: int
    slug: str
    title: str


TABLE: dict[type[Exception], Row] = {
    KeyInAddressError: Row(400, "key-in-address", "A key in the address"),
    KeyRefusedError: Row(401, "key-refused", "A key is needed"),
    ScopeError: Row(403, "scope-missing", "The key may not do this"),
    QuotaError: Row(429, "quota-used", "The quota of the key is used up"),
    SessionNotFoundError: Row(404, "session-not-found", "Unknown session"),
    OtherNodeError: Row(421, "other-node", "Of another node"),
    JobLostError: Row(410, "job-lost", "Job of an earlier run of the service"),
    JobNotFoundError: Row(404, "job-not-found", "Unknown job"),
    JobUnfinishedError: Row(409, "job-unfinished", "The job has not ended"),
    ScenarioNotFoundError: Row(404, "scenario-not-found", "Unknown scenario"),
    PressureUnknownError: Row(409, "pressure-unknown", "The pressure is unknown"),
    LeadRefusedError: Row(409, "lead-refused", "The session is not simulated in this tab"),
    SketchDroppedError: Row(409, "sketch-dropped", "The sketch was dropped"),
    UploadTooLargeError: Row(413, "upload-too-large", "The file is too large"),
    UnsupportedFormatError: Row(415, "unsupported-format", "The format of the body is not supported"),
    IdempotencyKeyError: Row(422, "idempotency-key-reused", "The key belongs to another request"),
    WorkTooLongError: Row(422, "work-too-long", "The work takes too long"),
    FieldError: Row(422, "bad-field", "A field is out of range"),
    SceneError: Row(422, "bad-scene", "The scene is not valid"),
    SketchError: Row(422, "bad-sketch", "The sketch is refused"),
    SimulationError: Row(422, "simulation-failed", "The simulation cannot go on"),
    ModelDamagedError: Row(503, "model-damaged", "A model of the server cannot be loaded"),
    TooManySessionsError: Row(503, "too-many-sessions", "No room for another session"),
    TooManyJobsError: Row(503, "too-many-jobs", "No room for another job"),
    MachineFullError: Row(503, "machine-full", "No time for another session"),
    StorageError: Row(503, "storage-failed", "A session cannot be kept on disk"),
    SessionBusyError: Row(503, "session-busy", "The session is busy"),
    UnavailableError: Row(503, "unavailable", "The service is not available now"),
    ServiceError: Row(400, "refused", "The request is refused"),
}
"""How HTTP answers each class of exceptions; a class that is not listed has the row of its nearest parent."""


def row_of(error: Exception) -> Row:
    """Return the table's row of an exception, or of its nearest parent with one."""
    return next(
        (TABLE[kind] for kind in type(error).__mro__ if kind in TABLE), Row(500, "internal", "Server error")
    )


def urn_of(row: Row) -> str:
    """Return the `type` of a kind of problem."""
    return f"urn:hybridmpm:problem:{row.slug}"


def problem_of(instance: str, error: Exception) -> Problem:
    """Return the problem of an exception at an address."""
    row = row_of(error)
    # Unexpected exceptions may quote anything; the server's log has them.
    detail = str(error) if row.status != 500 else "the server has a fault; its log has the cause"
    return Problem(**_body(instance, row, detail, fields_of(error)))


def _body(instance: str, row: Row, detail: str, errors: Sequence[tuple[str, str]]) -> dict[str, Any]:
    body: dict[str, Any] = {
        "type": urn_of(row),
        "title": row.title,
        "status": row.status,
        "detail": shortened(detail, MAX_DETAIL),
        "instance": shortened(instance, _MAX_INSTANCE),
    }
    if errors:
        body["errors"] = [
            {"field": shortened(field, _MAX_FIELD), "message": shortened(message, _MAX_MESSAGE)}
            for field, message in errors[:MAX_ERRORS]
        ]
    return body


def problem_response(
    instance: str,
    row: Row,
    detail: str,
    errors: Sequence[tuple[str, str]] = (),
    headers: dict[str, str] | None = None,
) -> Response:
    """Return the answer of a problem, with the first of its `errors`: pairs of a field and a message."""
    body = _body(instance, row, detail, errors)
    # JSON in ASCII, because messages quote the client's text, which may have half a surrogate pair.
    return Response(json.dumps(body), row.status, headers, media_type=MEDIA_TYPE)


def install(app: FastAPI) -> None:
    """Register handlers that answer every exception of the application with a problem."""
    app.add_exception_handler(HTTPException, _on_http_exception)
    app.add_exception_handler(RequestValidationError, _on_invalid_request)
    app.add_exception_handler(SimulationError, _on_known_error)
    app.add_exception_handler(ServiceError, _on_known_error)


def of_status(instance: str, status: int, detail: str, headers: dict[str, str] | None = None) -> Response:
    """Return the answer of an HTTP status without an exception of the service."""
    phrase = HTTPStatus(status).phrase
    row = Row(status, phrase.lower().replace(" ", "-"), phrase)
    return problem_response(instance, row, detail, headers=headers)


def fields_of(error: Exception) -> list[tuple[str, str]]:
    """Return the (field, message) pairs of an exception that names fields."""
    if isinstance(error, FieldError):
        return [(error.field, error.message)]
    if isinstance(error, SceneError):
        return [(f"body.scene.{field}" if field else "body.scene", text) for field, text in error.problems]
    return []


def response_of(instance: str, error: Exception) -> Response:
    """Return the answer of an exception of the service or the library."""
    forget_frames(error)
    row = row_of(error)
    headers = _HEADERS.get(row.status)
    return problem_response(instance, row, str(error), fields_of(error), headers)


def forget_frames(error: BaseException | None) -> None:
    """Free what the frames of an answered error refer to, such as a body, without a search for circles."""
    while error is not None:
        error.__traceback__, error = None, error.__context__


async def ended(*tasks: asyncio.Future[Any]) -> None:
    """Cancel tasks, wait until they have ended, and forget the frames in which they were cancelled."""
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    for task in tasks:
        if task.cancelled():
            try:
                task.result()
            except asyncio.CancelledError as error:
                forget_frames(error)


async def _on_known_error(request: Request, error: Exception) -> Response:
    return response_of(request.url.path, error)


async def _on_http_exception(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)  # noqa: S101 - registered for this class only
    detail = str(error.detail)
    if detail == HTTPStatus(error.status_code).phrase:
        detail = f"{detail}: {request.method} {request.url.path}"
    headers = dict(error.headers or {})
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = ", ".join(_methods(request))
    return of_status(request.url.path, error.status_code, detail, headers)


def _methods(request: Request) -> list[str]:
    """Return the methods of all operations at an address; Starlette lists those of the first one alone."""
    operations = request.app.state.operations
    here = [operation for operation in operations if operation.path_regex.match(request.url.path)]
    methods = {method for operation in here for method in operation.methods or ()} or {"GET"}
    return sorted(methods | ({"HEAD"} if "GET" in methods else set()))


async def _on_invalid_request(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)  # noqa: S101 - registered for this class only
    forget_frames(error)
    problems = error.errors()
    media_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    whole_body = any(problem["loc"] == ("body",) for problem in problems)
    if whole_body and media_type != "application/json" and await request.body():
        row = TABLE[UnsupportedFormatError]
        given = f"got {media_type!r}" if media_type else "got no Content-Type"
        return problem_response(request.url.path, row, f"the body must be application/json, {given}")
    errors = [_field_problem(problem) for problem in problems[:MAX_ERRORS]]
    detail = "; ".join(f"{field}: {message}" for field, message in errors)
    if len(problems) > MAX_ERRORS:
        detail = f"{len(problems)} fields are not valid, among them {detail}"
    row = Row(422, "bad-request", "The request is not valid")
    return problem_response(request.url.path, row, detail, errors)


def _field_problem(problem: dict[str, Any]) -> tuple[str, str]:
    message = str(problem["msg"]).removeprefix("Value error, ")
    if problem["type"] == "json_invalid":
        return "body", f"is not JSON: {problem['ctx']['error']} at character {problem['loc'][1]}"
    return field_path(problem["loc"]), message


def shortened(text: str, most: int) -> str:
    """Return a text, or its beginning where it has more than `most` characters."""
    return text if len(text) <= most else f"{text[: most - 4]} ..."

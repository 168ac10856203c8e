"""Errors of the service itself; those of the library are in `hybridmpm.errors`."""

from collections.abc import Sequence


class ServiceError(Exception):
    """Parent of the errors with which the service itself refuses a request."""


class SessionNotFoundError(ServiceError):
    """The session does not exist: it was never created, or has been deleted, or has expired."""


class OtherNodeError(ServiceError):
    """The session or job is of another node, which a proxy would have asked."""


class JobNotFoundError(ServiceError):
    """The job does not exist: it never did, or has been deleted, or ended long ago."""


class JobLostError(ServiceError):
    """The job is not of this run of the service, so it was lost when an earlier one ended."""


class JobUnfinishedError(ServiceError):
    """The job has no result yet."""


class ScenarioNotFoundError(ServiceError):
    """The address names a scenario that does not exist."""


class UnavailableError(ServiceError):
    """The request cannot be served now, but may be later."""


class TooManySessionsError(UnavailableError):
    """All sessions that the settings allow are in use."""


class MachineFullError(UnavailableError):
    """The load of a session does not fit beside those that play."""


class TooManyJobsError(UnavailableError):
    """All jobs that the settings allow still run."""


class SessionBusyError(UnavailableError):
    """Too many calls already wait for this session."""


class StorageError(UnavailableError):
    """A session cannot be written to disk, or read from it."""


class ModelDamagedError(UnavailableError):
    """The server's copy of a model cannot be loaded."""


class WorkTooLongError(ServiceError):
    """The work of a request takes longer, or more memory, than one request may."""


class IdempotencyKeyError(ServiceError):
    """The key of a request came with another request before."""


class SketchDroppedError(ServiceError):
    """The sketch was replaced, undone or ended by a reset before its preparation had ended."""


class LeadRefusedError(ServiceError):
    """The tab of a viewer cannot compute the frames of the session now."""


class PressureUnknownError(ServiceError):
    """The pressure is unknown: a network moves the particles of the session, or may."""


class UploadTooLargeError(ServiceError):
    """An uploaded file is larger than the limit."""


class KeyRefusedError(ServiceError):
    """The request needs a key or a link that is valid, and has none."""


class KeyInAddressError(ServiceError):
    """A token stands in the address of a request, where logs and histories keep it."""


class ScopeError(ServiceError):
    """The key of the request does not have the scope that this call needs."""


class QuotaError(ServiceError):
    """The sessions and jobs of a key take as much of the service as they may."""


class UnsupportedFormatError(ServiceError):
    """The body has a format that this address does not accept."""


class FieldError(ServiceError):
    """One field of a request has a value that is not allowed.

    Parameters
    ----------
    field : str
        Path of the field, e.g. "body.frames".
    message : str
        Fault of its value, and the allowed values.
    """

    def __init__(self, field: str, message: str) -> None:
        super().__init__(f"{field}: {message}")
        self.field = field
        self.message = message

    def __reduce__(self) -> tuple[type["FieldError"], tuple[str, str]]:
        """Pickle both parts, since errors also come from processes apart."""
        return type(self), (self.field, self.message)


def field_path(location: Sequence[int | str]) -> str:
    """Return pydantic's location of a field as text, e.g. body.strokes[0].points."""
    path = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return path.removeprefix(".")

"""What the service refuses by itself; the library's errors come on top."""


class ServiceError(Exception):
    """Parent of the service's own refusals."""


class SessionNotFoundError(ServiceError):
    """No such session: never created, deleted, or expired."""


class ScenarioNotFoundError(ServiceError):
    """No such scenario under this address."""


class UnavailableError(ServiceError):
    """Not now, but perhaps in a minute."""


class TooManySessionsError(UnavailableError):
    """The limit of sessions is reached."""


class SessionBusyError(UnavailableError):
    """Too many calls wait for this session."""


class ModelDamagedError(UnavailableError):
    """The server's copy of a model cannot be loaded."""


class UploadTooLargeError(ServiceError):
    """A file is larger than the limit."""


class UnsupportedFormatError(ServiceError):
    """A body in a format that this address does not take."""


class FieldError(ServiceError):
    """One field is wrong.

    Parameters
    ----------
    field : str
        Where, e.g. "body.frames".
    message : str
        What is wrong and what is allowed.
    """

    def __init__(self, field: str, message: str) -> None:
        super().__init__(f"{field}: {message}")
        self.field = field
        self.message = message

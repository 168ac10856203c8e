"""Server of the application: address, command line and orderly stop."""

import asyncio
import contextlib
import gc
import signal
import socket
import sys
import time
from collections.abc import Sequence
from typing import Any

import uvicorn
from fastapi import FastAPI

from hybridmpm.errors import ConfigError, SimulationError
from hybridmpm_service.app import create_app
from hybridmpm_service.http.connection import SURPLUS, StreamProtocol, request_protocol, stream_protocol
from hybridmpm_service.http.observed import log_config
from hybridmpm_service.keys.command import Parser
from hybridmpm_service.keys.ring import Ring
from hybridmpm_service.sessions.apart import prepare
from hybridmpm_service.sessions.manager import SessionManager
from hybridmpm_service.settings import Settings

WS_MAX_BYTES = 64 * 1024
"""Largest message of a client [bytes]; commands have some fifty."""
_FAREWELL_SECONDS = 0.6
"""Longest time that a stopping server waits for its streams to end."""
_GRACE_SECONDS = 1
"""Longest time that it then waits for answers."""
_UNACKNOWLEDGED_SECONDS = 20
"""Longest time that sent data may stay unacknowledged before the system ends the connection."""
_SEND_BUFFER_BYTES = 512 * 1024
"""Size of the system's send buffer of a connection.

By default it grows to megabytes, and a sleeping client would fill it for minutes.
"""


_SILENT_SECONDS = 60.0
"""Time between two messages in the log that connections cannot be taken."""
_SWITCH_SECONDS = 0.0005
"""Time after which a thread lets another one run Python code [s]; by default ten times as long."""
_GARBAGE = 700, 10, 1
"""Thresholds of the search for circles: a fifth of the usual number of objects between two full ones."""
_KEEP_SECONDS = 15
"""Time for which a connection is kept between two requests [s]: clients give theirs up earlier, so that none
sends a request while its connection ends."""
_BACKLOG = 1024
"""Number of new connections that may wait for the server."""
_ACCEPTED = 1
"""Number of new connections that the event loop takes at once. However many come together, each of its rounds
lasts some milliseconds, and those who have a connection go first."""
_FILES = 100
"""Files of the process itself, of libraries, models, jobs and answers."""
_FEWEST_CONNECTIONS = 16
"""Fewest connections that a server is worth starting for."""
_FILES_OF_SESSION = 4
"""Files of a session on disk: its database, which has a log and an index, and one that replaces it."""


class ServeError(SimulationError):
    """The service cannot start; the message has a remedy."""


def serve(host: str | None = None, port: int | None = None, **flags: Any) -> None:
    """Run the service until it is interrupted.

    Parameters
    ----------
    host, port : optional
        Address to listen on; if absent, HYBRIDMPM_HOST and HYBRIDMPM_PORT, else 127.0.0.1 and 8000.
    **flags
        Other fields of `Settings`; one that is None counts as absent.

    Raises
    ------
    ConfigError
        A setting is out of range.
    ServeError
        The service cannot listen on the address.
    """
    settings = with_files(Settings.load(host=host, port=port, **flags))
    _check_open(settings)
    listener = listen(settings)
    host_in_url = f"[{settings.host}]" if ":" in settings.host else settings.host
    url = f"http://{host_in_url}:{listener.getsockname()[1]}"
    sys.stdout.write(f"hybridmpm listens on {url} (Ctrl+C ends it)\n")
    sys.stdout.flush()
    with listener:
        # Threads that run Python code keep the event loop waiting for so long whenever it is woken.
        sys.setswitchinterval(_SWITCH_SECONDS)
        app = create_app(settings)
        # A search for circles in all that was imported would take a tenth of a second, amid any call.
        gc.collect()
        gc.freeze()
        # The more is to be freed by one, the longer it takes.
        gc.set_threshold(*_GARBAGE)
        # What the first check would have to wait for.
        prepare()
        make_server(app).run(sockets=[listener])


def _check_open(settings: Settings) -> None:
    """Check that nobody else is served without keys, unless the settings say so.

    Raises
    ------
    ConfigError
        The service can be reached from other machines and has no keys; or it has keys, and is to be open.
    """
    if settings.keys and settings.open:
        raise ConfigError("--open and --keys exclude each other: leave out --open, so that calls need a key")
    if settings.is_loopback or settings.keys:
        return
    if not settings.open:
        raise ConfigError(
            f"{settings.host} can be reached from other machines, and the service has no keys: make one with "
            "`hybridmpm key NAME --file keys` and add --keys keys; or add --open, if everybody who reaches "
            "the service may watch, change and delete all sessions"
        )
    sys.stderr.write(
        f"Warning: {settings.host} can be reached from other machines, and no call needs a key: every client "
        "can watch, change and delete all sessions.\n"
    )


def with_files(settings: Settings) -> Settings:
    """Return the settings with a number of connections that the process may open beside all else.

    The limit on open files is raised as far as the system allows.

    Raises
    ------
    ServeError
        The number of connections was chosen, and is too large; or there are files for hardly any.
    """
    try:
        import resource  # noqa: PLC0415 - absent on some systems
    except ImportError:
        return settings
    beside = _FILES + SURPLUS + _ACCEPTED + 2 * settings.max_jobs
    if settings.state_folder:
        beside += _FILES_OF_SESSION * settings.max_sessions
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = settings.max_connections + beside
    if soft == resource.RLIM_INFINITY or soft >= wanted:
        return settings
    files = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, files), hard))
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if files >= wanted:
        return settings
    most = files - beside
    is_chosen = "max_connections" in settings.model_fields_set
    if is_chosen or most < _FEWEST_CONNECTIONS:
        raise ServeError(
            f"{settings.max_connections} connections and {settings.max_sessions} sessions need {wanted} open "
            f"files, and this process may open {files}: raise the limit (ulimit -n {wanted}), or lower "
            "--max-connections or --max-sessions"
        )
    sys.stderr.write(
        f"Warning: this process may open {files} files, so it takes {most} connections in place of "
        f"{settings.max_connections}; raise the limit (ulimit -n {wanted}) for more.\n"
    )
    return settings.model_copy(update={"max_connections": most})


def listen(settings: Settings) -> socket.socket:
    """Return a socket that listens on the host and port of the settings.

    Raises
    ------
    ServeError
        The service cannot listen on the address.
    """
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    # asyncio switches Nagle's algorithm off only where the protocol is given. With it, the body of an answer
    # waits up to 40 ms for the acknowledgement of the header, and a frame for that of the frame before.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    # Connections inherit both.
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # on Linux
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 1000 * _UNACKNOWLEDGED_SECONDS)
    try:
        listener.bind((settings.host, settings.port))
        listener.listen(_BACKLOG)
    except OSError as err:
        listener.close()
        raise ServeError(
            f"cannot listen on {settings.host} port {settings.port}: {err.strerror or err}; "
            "choose another with --port or HYBRIDMPM_PORT"
        ) from None
    return listener


def make_server(app: FastAPI) -> uvicorn.Server:
    """Return a server of an application of `create_app`, with the limits of this service."""
    config = uvicorn.Config(
        app,
        log_config=log_config(app.state.settings.log_level, app.state.settings.log_format),
        access_log=False,
        server_header=False,
        forwarded_allow_ips=list(app.state.settings.proxies),
        # Frames do not compress, and commands are short.
        ws_per_message_deflate=False,
        ws_max_size=WS_MAX_BYTES,
        ws=stream_protocol(app.state.settings, app.state.rounds),
        http=request_protocol(app.state.settings, app.state.rounds),
        backlog=_ACCEPTED,
        timeout_keep_alive=_KEEP_SECONDS,
        # Sessions belong to this process, so there is only one.
        workers=1,
        timeout_graceful_shutdown=_GRACE_SECONDS,
    )
    return _Server(config, app.state.sessions, app.state.ring)


class _Server(uvicorn.Server):
    """Server that closes streams with code 1001 (going away), where uvicorn uses 1012."""

    def __init__(self, config: uvicorn.Config, sessions: SessionManager, ring: Ring | None) -> None:
        super().__init__(config)
        self._sessions, self._ring = sessions, ring
        self._silent_until = 0.0

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._on_fault)
        # Signals are of the main thread, and Windows has others.
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError, AttributeError):
            loop.add_signal_handler(signal.SIGUSR1, self._sessions.retire)
            if self._ring is not None:
                loop.add_signal_handler(signal.SIGHUP, self._ring.reload)
        await super().startup(sockets)
        for listener in sockets or ():
            # asyncio has one number for the connections that wait and those that are taken at once.
            listener.listen(_BACKLOG)

    def _on_fault(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Log a fault of the event loop; one that it meets thousands of times a second, once a minute."""
        if "socket.accept()" in context["message"]:
            if time.monotonic() < self._silent_until:
                return
            self._silent_until = time.monotonic() + _SILENT_SECONDS
        loop.default_exception_handler(context)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._sessions.drain()
        deadline = time.monotonic() + _FAREWELL_SECONDS
        # Streams end one by one, and nothing else waits for their end, so there is no event.
        while self._sessions.watched and time.monotonic() < deadline:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
        for connection in list(self.server_state.connections):
            if isinstance(connection, StreamProtocol):
                # Its client has not confirmed the end, and uvicorn would wait for that.
                connection.transport.abort()
        await super().shutdown(sockets)


def main(arguments: Sequence[str], command: str = "python -m hybridmpm_service") -> int:
    """Run the service from the command line and return the exit status; `command` is its name."""
    parser = Parser(
        prog=command,
        allow_abbrev=False,
        description="Serve hybridmpm over HTTP. An environment variable stands in for each flag, e.g. "
        "HYBRIDMPM_PORT for --port.",
    )
    for name, field in Settings.model_fields.items():
        default = ",".join(field.default) if isinstance(field.default, tuple) else field.default
        text = f"{field.description or ''} Default: {default or 'none'}."
        # --open stands alone; all others have a value.
        value: dict[str, Any] = {"nargs": "?", "const": "true"} if field.annotation is bool else {}
        parser.add_argument(f"--{name.replace('_', '-')}", help=text.replace("%", "%%"), **value)
    try:
        serve(**vars(parser.parse_args(arguments)))
    except ConfigError as err:
        sys.stderr.write(f"Error: {err}\n")
        return 2
    except SimulationError as err:
        sys.stderr.write(f"Error: {err}\n")
        return 1
    except KeyboardInterrupt:
        return 130
    return 0

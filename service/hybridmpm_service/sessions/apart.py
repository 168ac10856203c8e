"""Work in processes of its own, which can be ended at any moment, also within a compiled function.

Each piece of work is a fork of one template process that has imported the library, so it begins within
milliseconds. It is the module `template`.
"""

import asyncio
import atexit
import contextlib
import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")
_TEMPLATE = "hybridmpm_service.sessions.template"
SIZE = struct.Struct("<Q")
"""Length of a message between this process and a fork, before the message."""


CPU_SECONDS = 10
"""Longest time that a process computes before the system ends it [s]."""


class ApartError(Exception):
    """A process has ended without a result."""


class _Template:
    """The template process, started with the first piece of work. Safe to use from many threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._orders: socket.socket | None = None

    def fork(self, connection: socket.socket) -> None:
        """Fork a process at the other end of a connection."""
        with self._lock:
            if self._process is None or self._orders is None or self._process.poll() is not None:
                self._start()
            assert self._orders is not None  # noqa: S101 - made by `_start`
            socket.send_fds(self._orders, [b"f"], [connection.fileno()])

    def _start(self) -> None:
        self.stop()
        self._orders, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(  # noqa: S603 - ourselves
                [sys.executable, "-P", "-m", _TEMPLATE],
                # The same modules as here, wherever they were found.
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                # Its own group: an interrupt from the keyboard is for the service, which ends it.
                start_new_session=True,
            )

    def stop(self) -> None:
        """End the process and its forks."""
        if self._orders is not None:
            self._orders.close()
            self._orders = None
        if self._process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(1.0)
            self._process = None


# One for all applications of this process: it has no state of any of them.
_template = _Template()
atexit.register(_template.stop)


def prepare() -> None:
    """Start the template, so that the first piece of work does not wait for its imports."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        _template.fork(theirs)


async def run_apart(
    function: Callable[..., T], *arguments: Any, on_start: Callable[[int], object] = lambda _pid: None
) -> T:
    """Return the result of a function in a process of its own. A cancelled call kills the process.

    Parameters
    ----------
    function : callable
        At the top of a module that the library or the service has.
    *arguments
        Its arguments. They, the result and an exception have to be picklable.
    on_start : callable
        Called with the number of the process, before the function begins.

    Raises
    ------
    ApartError
        The process has ended without a result: it has computed for `CPU_SECONDS`, or lacked memory. Otherwise
        the exception of the function.
    """
    ours, theirs = socket.socketpair()
    try:
        with theirs:
            _template.fork(theirs)
        reader, writer = await asyncio.open_connection(sock=ours)
    except BaseException:
        ours.close()
        raise
    pid = 0
    try:
        (pid,) = SIZE.unpack(await reader.readexactly(SIZE.size))
        on_start(pid)
        order = pickle.dumps((function, arguments))
        writer.write(SIZE.pack(len(order)) + order)
        (size,) = SIZE.unpack(await reader.readexactly(SIZE.size))
        succeeded, result = pickle.loads(await reader.readexactly(size))  # noqa: S301 - from our own process
        pid = 0
    except (asyncio.IncompleteReadError, ConnectionError):
        pid = 0
        raise ApartError("the process of this work has ended without a result") from None
    finally:
        if pid:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        writer.close()
    if succeeded:
        return result  # type: ignore[no-any-return]
    try:
        raise result
    finally:
        # Its traceback refers to this frame, whose arguments may be large.
        del result

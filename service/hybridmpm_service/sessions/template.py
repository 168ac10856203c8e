"""The template process of work apart (see `apart`), and its forks.

It is single-threaded and contains no session. It ends with the service, however that ends, and takes all
forks along.
"""

import contextlib
import gc
import os
import pickle
import signal
import socket
import warnings
from typing import NoReturn

import hybridmpm.export  # noqa: F401 - forks encode clouds of particles
from hybridmpm_service.sessions import scene_work
from hybridmpm_service.sessions.apart import CPU_SECONDS, SIZE

_NICENESS = 3
"""Niceness of forks: what viewers wait for comes first."""
_MEMORY_BYTES = 8 << 30
"""Largest address space of a fork."""


def _work(connection: socket.socket) -> None:
    """Do one piece of work in a fork of the template."""
    os.nice(_NICENESS)
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource  # noqa: PLC0415 - absent on some systems

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS))
    connection.sendall(SIZE.pack(os.getpid()))
    with connection.makefile("rb") as orders:
        head = orders.read(SIZE.size)
        if len(head) < SIZE.size:
            return  # from `prepare`, or of a call that was cancelled at once
        function, arguments = pickle.loads(orders.read(SIZE.unpack(head)[0]))  # noqa: S301 - as above
    warnings.simplefilter("ignore")
    try:
        answer = (True, function(*arguments))
    except BaseException as error:  # noqa: BLE001 - raised again by the caller
        answer = (False, error)
    data = pickle.dumps(answer)
    connection.sendall(SIZE.pack(len(data)) + data)


def _serve() -> NoReturn:
    """Fork for each connection that arrives, until the service has gone."""
    # What the forks use is imported and read once, and shared.
    scene_work.warm_up()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    gc.freeze()
    with socket.socket(fileno=0) as orders:
        while True:
            message, (*places,), *_ = socket.recv_fds(orders, 1, 1)
            if not message:
                # Forks that are stopped would wait for ever.
                os.killpg(0, signal.SIGKILL)
            if os.fork() == 0:
                try:
                    orders.close()
                    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                    with socket.socket(fileno=places[0]) as connection, contextlib.suppress(OSError):
                        _work(connection)
                finally:
                    os._exit(0)
            os.close(places[0])


if __name__ == "__main__":
    _serve()

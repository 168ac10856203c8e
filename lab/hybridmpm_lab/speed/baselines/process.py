"""Simulations in processes of their own, for benchmarks."""

import os
import socket
import subprocess
import sys
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from hybridmpm.errors import SimulationError

_PROGRAM = Path(__file__).with_name("worker.py")


class Worker:
    """A process that runs worker.py; leaving the `with` block ends it.

    Parameters
    ----------
    package : str
        "hybridmpm" for a build of this library, else the package of a peer.
    build : Path, optional
        Checkout of another build of this library, whose extension lies in its folder `python`.
    """

    def __init__(self, package: str, build: Path | None = None) -> None:
        ours, theirs = socket.socketpair()
        environment = dict(os.environ)
        if build is not None:
            environment["PYTHONPATH"] = str(build / "python")
        # -P: the folder of the program must not hide packages.
        command = [sys.executable, "-P", str(_PROGRAM), str(theirs.fileno()), package]
        self._package = package if build is None else str(build)
        self._process = subprocess.Popen(  # noqa: S603 - our own program
            command, pass_fds=[theirs.fileno()], env=environment
        )
        theirs.close()
        self._link = Connection(ours.detach())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._link.close()
        self._process.wait()

    def call(self, method: str, *arguments: Any) -> Any:
        """Call a method of the simulation in the process and return what it returns.

        Raises
        ------
        SimulationError
            The method raised; the message holds its traceback. Or the process has ended.
        """
        try:
            self._link.send((method, arguments))
            done, result = self._link.recv()
        except (EOFError, OSError):
            code = self._process.wait()
            raise SimulationError(f"the process of {self._package} has ended with exit code {code}") from None
        if not done:
            raise SimulationError(f"{method} failed in {self._package}:\n{result}")
        return result

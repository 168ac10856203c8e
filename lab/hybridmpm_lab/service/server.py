"""The service as a process of its own, and what the system tells of it."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

from hybridmpm.errors import ConfigError, SimulationError

_PACKAGE = "hybridmpm_service"
_SETTINGS = "HYBRIDMPM_"
"""Begins the environment variables that set the service up."""


class Server:
    """A server on a free port of this machine; leaving the `with` block kills it.

    It has its default settings, whatever the environment says, but admits any load: what is measured is how
    it serves, not whom it turns away.

    Parameters
    ----------
    *flags : str
        More flags of `python -m hybridmpm_service`.

    Raises
    ------
    ConfigError
        The service is not installed.
    SimulationError
        The process has ended before it listened.
    """

    def __init__(self, *flags: str) -> None:
        if importlib.util.find_spec(_PACKAGE) is None:
            raise ConfigError("the service is not installed; install it with: pip install hybridmpm-service")
        environment = {name: text for name, text in os.environ.items() if not name.startswith(_SETTINGS)}
        command = [sys.executable, "-m", _PACKAGE, "--port", "0", "--max-load", "1024", *flags]
        self._process = subprocess.Popen(  # noqa: S603 - our own program
            command, stdout=subprocess.PIPE, text=True, env=environment
        )
        told = self._process.stdout
        address = re.search(r"127\.0\.0\.1:(\d+)", told.readline() if told else "")
        if address is None:
            self._process.communicate()
            code = self._process.returncode
            raise SimulationError(f"the service ended with exit code {code} before it listened; see above")
        self.address = address[0]
        """Host and port, for URLs."""
        self._port = int(address[1])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()
        self._process.communicate()

    def kill(self) -> None:
        """End the process at once, as `kill -9` does."""
        self._process.kill()

    def memory(self) -> int | None:
        """Return the memory of the process [bytes]; None where the system does not tell (only Linux does)."""
        try:
            text = Path(f"/proc/{self._process.pid}/status").read_text(encoding="ascii", errors="replace")
        except OSError:
            return None
        found = re.search(r"VmRSS:\s*(\d+) kB", text)
        return None if found is None else 1024 * int(found[1])

    def queued(self, client_port: int) -> int:
        """Return the bytes that the system keeps for a client that has not taken them; 0 if it does not tell.

        Parameters
        ----------
        client_port : int
            The client's own port, on this machine.
        """
        try:
            lines = Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]
        except OSError:
            return 0
        ours, theirs = f":{self._port:04X}", f":{client_port:04X}"
        rows = [line.split() for line in lines]
        return sum(
            int(row[4].split(":")[0], 16) for row in rows if row[1].endswith(ours) and row[2].endswith(theirs)
        )

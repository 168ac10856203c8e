"""The service as a process of its own, and its memory as the system reports it."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from hybridmpm.errors import SimulationError

_SETTINGS = "HYBRIDMPM_"  # Prefix of the environment variables that configure the service


@dataclass(frozen=True, eq=False)
class Server:
    """A running server on this machine."""

    process: "subprocess.Popen[str]"
    port: int

    @property
    def address(self) -> str:
        """Address of the server."""
        return f"http://127.0.0.1:{self.port}"

    def computed(self) -> float:
        """Return the time that cores have computed for the process [s]; on Linux alone."""
        text = Path(f"/proc/{self.process.pid}/stat").read_text(encoding="ascii", errors="replace")
        fields = text.rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def memory(self, kind: str = "VmRSS") -> int | None:
        """Return the memory of the process [bytes], with "VmHWM" the largest so far; None without /proc."""
        try:
            text = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii", errors="replace")
        except OSError:
            return None
        found = re.search(rf"{kind}:\s*(\d+) kB", text)
        return None if found is None else 1024 * int(found[1])


@contextmanager
def running(*flags: str) -> Iterator[Server]:
    """Start a server on a free port, and kill it at the end, as `kill -9` does.

    It has its default settings, whatever the environment contains, but admits any load. `flags` are more
    flags of `python -m hybridmpm_service`.

    Raises
    ------
    SimulationError
        The process has ended before it listened.
    """
    environment = {name: text for name, text in os.environ.items() if not name.startswith(_SETTINGS)}
    command = [sys.executable, "-m", "hybridmpm_service", "--port", "0", "--max-load", "1024", *flags]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:  # noqa: S603
        try:
            port = re.search(r"127\.0\.0\.1:(\d+)", process.stdout.readline() if process.stdout else "")
            if port is None:
                code = process.wait()
                raise SimulationError(f"the service ended with code {code} before it listened; see above")
            yield Server(process, int(port[1]))
        finally:
            process.kill()

"""The folder in which a service keeps its sessions, one file for each."""

import re
import sqlite3
from pathlib import Path

from hybridmpm.errors import ConfigError
from hybridmpm_service.sessions.journal.origin import Origin
from hybridmpm_service.sessions.journal.session_file import SessionFile, begun

_SUFFIX = ".session"
_NAME = re.compile(r"[0-9a-f]{32}")


class Folder:
    """A folder of session files, which one service at a time may use.

    Parameters
    ----------
    path : Path
        Made if it does not exist.

    Raises
    ------
    ConfigError
        The folder cannot be written, or another service uses it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            # The system lets go of the lock when the process ends, however it does.
            self._lock = sqlite3.connect(path / "lock", timeout=0, isolation_level=None)
            self._lock.execute("BEGIN EXCLUSIVE")
        except (sqlite3.Error, OSError) as err:
            raise ConfigError(
                f"state_folder: {path} cannot be used: {err}. It must be a folder that the service may "
                "write, and that no other service uses"
            ) from None

    def names(self) -> list[str]:
        """Return the names of the sessions that have a file, in the order in which they began."""
        files = [path for path in self._path.glob(f"*{_SUFFIX}") if _NAME.fullmatch(path.stem)]
        return [path.stem for path in sorted(files, key=lambda path: (begun(path), path.stem))]

    def create(self, name: str, origin: Origin) -> SessionFile:
        """Return the new file of a session; errors as `SessionFile.create`."""
        return SessionFile.create(self._path / f"{name}{_SUFFIX}", origin)

    def open(self, name: str) -> SessionFile:
        """Return the file of a session that `names` lists.

        Raises
        ------
        StorageError
            It cannot be read.
        """
        return SessionFile(self._path / f"{name}{_SUFFIX}")

    def close(self) -> None:
        """Let another service use the folder."""
        self._lock.close()

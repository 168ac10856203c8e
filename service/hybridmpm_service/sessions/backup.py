"""Copy a state folder, also while the service runs: python -m hybridmpm_service.sessions.backup STATE COPY.

The file of each session is copied as it was at one moment, with all that was written before, as SQLite copies
a database that is in use. Sessions are copied one after the other; none depends on another. To restore, start
the service with the copy as its state folder.
"""

import contextlib
import sqlite3
import sys
from pathlib import Path


def back_up(state: Path, copy: Path) -> int:
    """Copy the sessions of a folder to a new one; return their number.

    Raises
    ------
    OSError, sqlite3.Error
        The folder of the copy exists, or a file cannot be read or written.
    """
    copy.mkdir(parents=True)
    copied = 0
    for file in sorted(state.glob("*.session")):
        target = copy / file.name
        try:
            with (
                contextlib.closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as source,
                contextlib.closing(sqlite3.connect(target)) as destination,
            ):
                source.backup(destination)
        except sqlite3.OperationalError:
            target.unlink(missing_ok=True)
            if file.exists():
                raise
            # The session has ended meanwhile.
            continue
        copied += 1
    return copied


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python -m hybridmpm_service.sessions.backup STATE COPY")
    sys.stdout.write(f"{back_up(Path(sys.argv[1]), Path(sys.argv[2]))} sessions copied\n")

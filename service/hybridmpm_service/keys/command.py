"""The command `hybridmpm key`, which adds a key to a file and shows its token, once."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from hybridmpm.errors import ConfigError
from hybridmpm_service.keys.callers import SCOPES
from hybridmpm_service.keys.file import QUOTAS, add


class Parser(argparse.ArgumentParser):
    """Flags of a command line; a mistake is one line."""

    def error(self, message: str) -> NoReturn:
        """End the process with the status of a wrong command line."""
        self.exit(2, f"Error: {message}\n")


def main(arguments: Sequence[str], command: str) -> int:
    """Add a key from the command line and return the exit status; `command` is its name."""
    parser = Parser(
        prog=command,
        allow_abbrev=False,
        description="Add a key to a file of keys, and print its token, which is shown once and kept nowhere. "
        "A service that runs reads the file again on SIGHUP. To take a key back, delete its line.",
    )
    parser.add_argument("name", help="name of the key: up to 32 small letters, digits and dashes")
    parser.add_argument("--file", default="keys", help="file of keys; made if there is none. Default: keys.")
    text = f"what it may do, of {','.join(SCOPES)}. Default: view,steer,create."
    parser.add_argument("--scopes", default="view,steer,create", help=text)
    parser.add_argument("--of", metavar="NAME", help="key whose sessions it acts on; its own if absent")
    texts = {
        "sessions": "largest number of its sessions on a node",
        "load": "largest load of its sessions that play [cores]",
        "jobs": "largest number of its jobs",
        "bytes": "size of its files from which it begins nothing more",
    }
    for name in QUOTAS:
        parser.add_argument(f"--{name}", metavar="NUMBER", help=f"{texts[name]}; no limit if absent")
    given = vars(parser.parse_args(arguments))
    path = Path(given["file"])
    try:
        token = add(
            path,
            given["name"],
            given["scopes"],
            [f"{name}={given[name]}" for name in ("of", *QUOTAS) if given[name] is not None],
        )
    except ConfigError as err:
        sys.stderr.write(f"Error: {err}\n")
        return 2
    sys.stderr.write(f"{path} has the key {given['name']!r} now; its token is shown this once:\n")
    sys.stdout.write(f"{token}\n")
    return 0

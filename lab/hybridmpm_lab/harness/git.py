"""Asking git about a checkout."""

import subprocess
from pathlib import Path

from hybridmpm.errors import ConfigError


def git(folder: Path, *arguments: str) -> str:
    """Run git in a folder and return the text that it prints, stripped; raises as `git_bytes`."""
    return git_bytes(folder, *arguments).decode("utf-8", "surrogateescape").strip()


def git_bytes(folder: Path, *arguments: str) -> bytes:
    """Run git in a folder and return what it prints, to the last byte.

    Raises
    ------
    ConfigError
        Git is not installed, the folder is in no checkout, or git refuses the arguments.
    """
    command = ["git", "-C", str(folder), *arguments]
    try:
        return subprocess.run(command, capture_output=True, check=True).stdout  # noqa: S603 - constants
    except OSError as error:
        raise ConfigError(f"this needs git: {error.strerror or error}") from None
    except subprocess.CalledProcessError as error:
        said = error.stderr.decode(errors="replace").strip()
        raise ConfigError(f"{folder}: {said}; run this in a checkout with its history") from None

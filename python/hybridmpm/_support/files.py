"""Files that are written whole or not at all, and files whose digest is known."""

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hybridmpm.errors import DataError, ExportError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`, and rename its file to `path` after the block.

    The temporary name has the suffix of `path`, since encoders choose the format by it. After any exception,
    interrupts included, the temporary file is removed.

    Raises
    ------
    ExportError
        The folder does not exist, or a file in it cannot be written.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def read_checked(path: Path, sha256: str) -> bytes:
    """Return the bytes of a file that comes with the library, if its SHA-256 is the one known to it.

    Raises
    ------
    DataError
        The file is missing or another one; the message then has both digests.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DataError(f"cannot read {path}: {error.strerror or error}; install the library anew") from None
    digest = hashlib.sha256(data).hexdigest()
    if digest != sha256:
        raise DataError(
            f"{path} is damaged or another file: its SHA-256 is {digest}, the manifest has {sha256}; install "
            "the library anew"
        )
    return data

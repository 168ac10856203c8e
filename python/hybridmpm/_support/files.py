"""Files that are written whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hybridmpm.errors import ExportError


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
        # Where there is no such file, or no such name can be, nothing is left to remove.
        with suppress(OSError):
            part.unlink()

"""Writing files so that an interruption leaves the old file or the new one, never half of one."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hybridmpm.errors import ExportError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path beside `path` to write to, and move it there once the block succeeded.

    The name keeps the suffix, since encoders choose by it. On any exception, an interrupt among them, it is
    removed.

    Raises
    ------
    ExportError
        The folder does not exist or refuses the file.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise ExportError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)

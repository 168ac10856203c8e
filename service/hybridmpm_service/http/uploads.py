"""Reading of uploaded files; their bytes are counted while they arrive, whatever a header says."""

from typing import Protocol

from hybridmpm_service.errors import UploadTooLargeError

_CHUNK = 64 * 1024


class Source(Protocol):
    """Something to read from, such as Starlette's UploadFile."""

    async def read(self, size: int = -1) -> bytes:
        """Return at most `size` bytes; b"" at the end."""


async def read_limited(source: Source, max_bytes: int) -> bytes:
    """Return everything that a source gives, and read at most one chunk beyond the limit.

    Raises
    ------
    UploadTooLargeError
        The source gives more than `max_bytes` bytes.
    """
    data = bytearray()
    while chunk := await source.read(_CHUNK):
        data += chunk
        if len(data) > max_bytes:
            raise UploadTooLargeError(f"sketch: the file has more than the allowed {max_bytes} bytes")
    return bytes(data)

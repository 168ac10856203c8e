"""Uploads are counted while they are read."""

import asyncio

import pytest

from hybridmpm_service.errors import UploadTooLargeError
from hybridmpm_service.http.sketches import read_limited


class _Endless:
    """A file that never ends, and counts what was read of it."""

    given = 0

    async def read(self, size: int = -1) -> bytes:
        self.given += size
        return bytes(size)


class _Finite:
    def __init__(self, data: bytes) -> None:
        self._data = data

    async def read(self, size: int = -1) -> bytes:
        chunk, self._data = self._data[:size], self._data[size:]
        return chunk


def test_everything_up_to_the_limit_is_returned() -> None:
    data = bytes(range(256)) * 1000
    assert asyncio.run(read_limited(_Finite(data), len(data))) == data


def test_one_byte_more_is_refused_with_the_limit() -> None:
    with pytest.raises(UploadTooLargeError, match="999"):
        asyncio.run(read_limited(_Finite(bytes(1000)), 999))


def test_an_endless_file_is_not_read_to_its_end() -> None:
    source = _Endless()
    with pytest.raises(UploadTooLargeError):
        asyncio.run(read_limited(source, 100_000))
    assert source.given < 300_000

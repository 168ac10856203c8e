"""DeepMind's tfrecords, read without tensorflow: the framing of the records and the few protocol buffers.

A record is a length (8 bytes), the checksum of the length (4), a `SequenceExample` and its checksum (4). The
context of the example has `particle_type`, the bytes of int64 (N,); its feature list `position` has a string
for each frame, the bytes of float32 (N D) (Sanchez-Gonzalez et al. 2020, reading_utils.py). Only checksums of
lengths are checked; a damaged example is found by its sizes.
"""

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

import numpy as np

from hybridmpm._support.protobuf import messages
from hybridmpm.data import metadata
from hybridmpm.data.formats.layout import Format, chosen, files_as_splits
from hybridmpm.data.trajectory import Place, Trajectory
from hybridmpm.errors import DataError
from hybridmpm.scene.particle_types import UNCHANGED, translated

_LENGTH = struct.Struct("<QI")
_MASK = 0xA282EAD8
_POLYNOMIAL = 0x82F63B78


def crc32c(data: bytes) -> int:
    """Return the CRC-32C (Castagnoli) of a few bytes; it goes bit by bit and is slow for many."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (_POLYNOMIAL if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def masked(crc: int) -> int:
    """Return a checksum in the form that records store, rotated and shifted."""
    return ((crc >> 15 | crc << 17) + _MASK) & 0xFFFFFFFF


def _records(file: IO[bytes], path: Path) -> Iterator[tuple[int, int]]:
    """Yield position in the file and length of each record's data [bytes], which are not read."""
    size = path.stat().st_size
    start, number = 0, 0
    while start < size:
        file.seek(start)
        head = file.read(_LENGTH.size)
        length, checksum = _LENGTH.unpack(head) if len(head) == _LENGTH.size else (0, None)
        if checksum != masked(crc32c(head[:8])):
            raise DataError(f"{path}: record {number} is damaged: the checksum of its length does not match")
        start += _LENGTH.size
        if start + length + 4 > size:
            raise DataError(f"{path}: record {number} is cut off")
        yield start, length
        start, number = start + length + 4, number + 1


def _map(data: memoryview) -> dict[str, memoryview]:
    """Return the entries of a `map<string, message>`, the first field of Features and FeatureLists."""
    entries = {}
    for number, entry in messages(data):
        if number == 1:
            parts = dict(messages(entry))
            entries[bytes(parts[1]).decode()] = parts.get(2, memoryview(b""))
    return entries


def _strings(feature: memoryview) -> list[memoryview]:
    """Return the values of a Feature that has a BytesList."""
    lists = dict(messages(feature))
    if 1 not in lists:
        raise ValueError("a feature holds no bytes")
    return [value for number, value in messages(lists[1]) if number == 1]


def _example(data: bytes, path: Path, number: int, dim: int, states: int) -> Trajectory:
    where = f"{path}: record {number}"
    try:
        parts = dict(messages(memoryview(data)))
        context, lists = _map(parts.get(1, memoryview(b""))), _map(parts.get(2, memoryview(b"")))
    except (ValueError, KeyError) as error:
        raise DataError(f"{where} is damaged or no SequenceExample: {error}") from None
    for key, there in (("particle_type", context), ("position", lists)):
        if key not in there:
            raise DataError(
                f"{where}: the key {key} is missing; the record holds {', '.join(there) or 'nothing'}"
            )
    try:
        given = _strings(context["particle_type"])[0]
        frames = [_strings(feature)[0] for number, feature in messages(lists["position"]) if number == 1]
    except (ValueError, KeyError, IndexError) as error:
        raise DataError(f"{where} is damaged: {error}") from None
    sizes = {len(frame) for frame in frames}
    if given and sizes == {dim * len(given)}:
        raise DataError(
            f"{where}: particle_type must be int64, but its 4 bytes for each of {len(given) // 4} particles "
            "are int32: write it anew by .astype('int64')"
        )
    if len(given) % 8:
        raise DataError(f"{where} is damaged: particle_type has {len(given)} bytes, no whole number of int64")
    types = np.frombuffer(given, "<i8").astype(np.int64)
    if len(sizes) != 1 or sizes != {4 * dim * len(types)}:
        counts = ", ".join(f"{size / (4 * dim):g}" for size in sorted(sizes)[:4]) or "none"
        raise DataError(f"{where}: position must hold {len(types)} particles in every frame, got {counts}")
    if len(frames) != states:
        raise DataError(
            f"{where}: position must have sequence_length + 1 = {states} frames, as metadata.json says, got "
            f"{len(frames)}"
        )
    return Trajectory(
        positions=np.stack([np.frombuffer(frame, "<f4").reshape(-1, dim) for frame in frames]).astype(
            np.float32
        ),
        types=translated(types, UNCHANGED, where=f"{where}: particle_type"),
        place=Place(where),
    )


def _file(folder: Path, split: str) -> Path:
    path = folder / f"{split}.tfrecord"
    if not path.is_file():
        raise DataError(f"{path} does not exist")
    return path


def _count(folder: Path, split: str) -> int:
    path = _file(folder, split)
    with path.open("rb") as file:
        return sum(1 for _ in _records(file, path))


def _read(folder: Path, split: str, numbers: Iterable[int] | None) -> Iterator[Trajectory]:
    path = _file(folder, split)
    about = metadata.read(folder)
    wanted = None if numbers is None else chosen(numbers, _count(folder, split), path)
    with path.open("rb") as file:
        for number, (start, length) in enumerate(_records(file, path)):
            if wanted is None or number in wanted:
                file.seek(start)
                yield _example(file.read(length), path, number, about["dim"], about["sequence_length"] + 1)


DEEPMIND = Format(
    name="deepmind",
    text='tfrecords of DeepMind\'s "Learning to Simulate": {train,valid,test}.tfrecord; read only',
    splits=files_as_splits(".tfrecord"),
    count=_count,
    read=_read,
    write=None,
    keeps=frozenset(),
)

"""Uploads that are made to cost the server much: it should refuse each soon and briefly."""

import json
import random
import struct
import zlib
from dataclasses import dataclass

_SIZE = 2048  # Side of the largest picture that the service takes [pixels]
_BOMB_SIZE = 20_000  # Side of a picture that would fill gigabytes


@dataclass(frozen=True)
class Upload:
    """A hostile body."""

    target: str
    """Last part of its address: "sessions", or a resource of a session."""
    content: bytes
    is_picture: bool = False
    """Whether it is sent as the PNG of a sketch; else it is sent as JSON."""


def uploads() -> list[Upload]:
    """Return the uploads, the same ones in every run."""
    many = {"scene": {"dim": 2, "bodies": [{}] * 690_000}}
    noise = random.Random(0)
    # Each row begins with its filter, 0 for none.
    rows = b"".join(b"\0" + noise.randbytes(_SIZE // 8) for _ in range(_SIZE))
    picture = _png(_SIZE, rows)
    return [
        Upload("sessions", json.dumps(many, separators=(",", ":")).encode()),
        Upload("sessions", b"[" * (1 << 20)),
        Upload("sketches", json.dumps({"strokes": [{"points": [[2, -2]] * 4096}]}).encode()),
        Upload("sketches", picture, is_picture=True),
        Upload("sketches", picture[: len(picture) // 2], is_picture=True),
        Upload("sketches", _png(_BOMB_SIZE, bytes(_BOMB_SIZE * (_BOMB_SIZE // 8 + 1))), is_picture=True),
        Upload("sketches", random.Random(1).randbytes(1_000_000), is_picture=True),
        Upload("trajectories", b"\xff" * 1_000_000),
    ]


def _png(size: int, rows: bytes) -> bytes:
    """Return a square picture of one bit a pixel."""
    header = struct.pack(">IIBBBBB", size, size, 1, 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows, 1)), (b"IEND", b""))
    chunks = (
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)

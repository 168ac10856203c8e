"""Snapshot files: a scene, the settings of its simulator and its state, in one file with a checksum.

docs/reference/snapshots.md describes the layout.
"""

import hashlib
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hybridmpm import _core
from hybridmpm._support.files import replacing
from hybridmpm._support.packing import number
from hybridmpm.errors import ConfigError, SnapshotError
from hybridmpm.scene import Scene

MAGIC = b"HMPMFILE"
VERSION = 2
_PREFIX = struct.Struct("<8sII")
"""Magic, version, length of the header."""
_CHECKSUM = hashlib.sha256().digest_size


@dataclass(frozen=True, kw_only=True)
class SavedState:
    """Content of a snapshot file."""

    kind: str
    """Kind of the simulator; see `Simulator.kind`."""
    scene: Scene
    settings: dict[str, Any]
    """Settings of the simulator, as plain data."""
    frame: int
    """Number of frames since the start."""
    state: bytes
    """Snapshot of the simulator; see `Simulator.snapshot`."""


def write_state(path: Path, saved: SavedState) -> None:
    """Write a snapshot file, whole or not at all; raises `ExportError`."""
    header = json.dumps(
        {
            "hybridmpm": _core.__version__,
            "simulator": saved.kind,
            "frame": saved.frame,
            "settings": saved.settings,
            "scene": saved.scene.model_dump(mode="json", exclude_none=True),
        },
        default=number,
    ).encode()
    body = _PREFIX.pack(MAGIC, VERSION, len(header)) + header + saved.state
    with replacing(path) as part:
        part.write_bytes(body + hashlib.sha256(body).digest())


def read_state(path: Path) -> SavedState:
    """Read a snapshot file.

    Raises
    ------
    SnapshotError
        The file is foreign, of another version, damaged or cut off.
    OSError
        The file cannot be read.
    """
    data = path.read_bytes()
    if len(data) < _PREFIX.size or not data.startswith(MAGIC):
        raise SnapshotError(f"{path} is no snapshot file of hybridmpm, or it is cut off after a few bytes")
    _, version, length = _PREFIX.unpack_from(data)
    if version != VERSION:
        raise SnapshotError(
            f"{path} has format version {version}, but this hybridmpm reads version {VERSION}: open it with "
            "the version that wrote it"
        )
    body, checksum = data[:-_CHECKSUM], data[-_CHECKSUM:]
    if hashlib.sha256(body).digest() != checksum:
        raise SnapshotError(f"{path} is damaged or cut off: its checksum does not match")
    state = _PREFIX.size + length
    try:
        header = json.loads(body[_PREFIX.size : state])
        return SavedState(
            kind=header["simulator"],
            scene=Scene.parse(header["scene"]),
            settings=dict(header["settings"]),
            frame=header["frame"],
            state=body[state:],
        )
    except (ValueError, KeyError, TypeError, ConfigError) as error:
        # The checksum is right, so a program wrote it so.
        raise SnapshotError(f"{path} has a header that this version does not understand: {error}") from error

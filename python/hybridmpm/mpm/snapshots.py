"""Snapshot files: a scene, the settings of its solver and its state, in one file with a checksum.

The layout is described in docs/snapshots.md.
"""

import hashlib
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from hybridmpm import _native
from hybridmpm._support.files import replacing
from hybridmpm.errors import ConfigError, SnapshotError
from hybridmpm.mpm.sleep import Sleep
from hybridmpm.scene import Scene

Substeps = Literal["cfl", "reference"] | int

MAGIC = b"HMPMFILE"
VERSION = 1
_PREFIX = struct.Struct("<8sII")
"""Magic, version, length of the header."""
_CHECKSUM = hashlib.sha256().digest_size


@dataclass(frozen=True, kw_only=True)
class SavedState:
    """What a file holds."""

    scene: Scene
    substeps: Substeps
    cfl: float | None
    allow_unstable: bool
    sleep: Sleep | None
    r_p: float
    frame: int
    state: bytes
    """The core's own snapshot."""


def write_state(path: Path, saved: SavedState) -> None:
    """Write a snapshot file, whole or not at all; raises `ExportError`."""
    header = json.dumps(
        {
            "hybridmpm": _native.__version__,
            "frame": saved.frame,
            "substeps": saved.substeps,
            "cfl": saved.cfl,
            "allow_unstable": saved.allow_unstable,
            "sleep": None if saved.sleep is None else saved.sleep.model_dump(),
            "r_p": saved.r_p,
            "scene": saved.scene.model_dump(mode="json", exclude_none=True),
        }
    ).encode()
    body = _PREFIX.pack(MAGIC, VERSION, len(header)) + header + saved.state
    with replacing(path) as part:
        part.write_bytes(body + hashlib.sha256(body).digest())


def read_state(path: Path) -> SavedState:
    """Read a snapshot file.

    Raises
    ------
    SnapshotError
        It is foreign, of another version, damaged or cut off.
    OSError
        It cannot be read.
    """
    data = path.read_bytes()
    if len(data) < _PREFIX.size or not data.startswith(MAGIC):
        raise SnapshotError(f"{path} is no snapshot file of hybridmpm, or it is cut off after a few bytes")
    _, version, length = _PREFIX.unpack_from(data)
    if version != VERSION:
        raise SnapshotError(
            f"{path} has format version {version}, but this hybridmpm reads version {VERSION}: "
            "open it with the version that wrote it"
        )
    body, checksum = data[:-_CHECKSUM], data[-_CHECKSUM:]
    if hashlib.sha256(body).digest() != checksum:
        raise SnapshotError(f"{path} is damaged or cut off: its checksum does not match")
    state = _PREFIX.size + length
    try:
        header = json.loads(body[_PREFIX.size : state])
        return SavedState(
            scene=Scene.parse(header["scene"]),
            substeps=header["substeps"],
            cfl=header["cfl"],
            allow_unstable=header["allow_unstable"],
            sleep=None if header["sleep"] is None else Sleep.model_validate(header["sleep"]),
            r_p=header["r_p"],
            frame=header["frame"],
            state=body[state:],
        )
    except (ValueError, KeyError, TypeError, ConfigError) as error:
        # The checksum is right, so a program wrote it so.
        raise SnapshotError(f"{path} has a header that this version does not understand: {error}") from error
